/* Between the firmware and its bench. */
#include <stdint.h>

/* In bench.c. */
int open_bench(const char *path);
int bench_waits_for(void);
void serve_bench(void);

/* In firmware.c: what the bench sets and observes. */
void drive_input(uint16_t value);
void wire_input(void);
int input_is_driven(void);
uint16_t get_input(void);
void set_power(int on);
int has_power(void);
