//! Suction mode, the emergency operation in case of leaks (3.4.2, 3.4.3, 3.4.8).
