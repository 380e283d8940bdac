/* Tells `harness fuzz` which edges of the program a session has taken. It is linked into a program
 * that is compiled with -fsanitize-coverage=trace-pc-guard (clang) or =trace-pc (gcc), and is itself
 * compiled without it. Without `harness fuzz`, which names a file, nothing is counted.
 *
 * Any program on a POSIX system can link it: it needs nothing of this example. */
#include <fcntl.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#define COUNTERS 65536u

static uint8_t *counters;

static void count(uint32_t place)
{
	if (counters && counters[place % COUNTERS] < 255)
		counters[place % COUNTERS]++;
}

__attribute__((constructor)) static void open_counters(void)
{
	const char *name = getenv("HARNESS_COVERAGE");
	int file = name ? open(name, O_RDWR) : -1;
	void *map;

	if (file < 0)
		return;
	map = mmap(NULL, COUNTERS, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
	if (map != MAP_FAILED)
		counters = map;
	close(file);
}

/* clang: the guards of a module are numbered once. */
void __sanitizer_cov_trace_pc_guard_init(uint32_t *start, uint32_t *stop)
{
	static uint32_t last;

	if (start == stop || *start)
		return;
	while (start < stop)
		*start++ = ++last;
}

void __sanitizer_cov_trace_pc_guard(uint32_t *guard)
{
	count(*guard);
}

/* gcc: the address of the block, from one in this program on, since it lies elsewhere each time.
 * Two places differ by some bytes only: they are spread over the counters. */
void __sanitizer_cov_trace_pc(void)
{
	uintptr_t here = (uintptr_t)__builtin_return_address(0);
	uintptr_t from = (uintptr_t)&__sanitizer_cov_trace_pc;

	count((uint32_t)(here - from) * 2654435761u >> 16);
}
