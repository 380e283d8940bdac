//! What the DRR460 does.
