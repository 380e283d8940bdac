/* The bench of the program: `--bench unix:PATH` sets and observes what stands around the device.
 * Each request is a line of JSON, and so is its answer. A bench of another firmware has its own
 * names and values in `set` and `get`; the rest of this file stays as it is. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "bench.h"

#define NAMES "{\"names\":[\"power\",\"input\"]}"

static int listener = -1, client = -1;

/* Does what a request says, `{"set":{"input":1200}}`; whether there is such a thing. */
static int set(const char *request)
{
	unsigned value;
	int end = 0;

	if (sscanf(request, "{\"set\":{\"input\":%u}}%n", &value, &end) == 1 && end &&
	    !request[end] && value <= UINT16_MAX)
		drive_input((uint16_t)value);
	else if (!strcmp(request, "{\"set\":{\"input\":\"wired\"}}"))
		wire_input();
	else if (!strcmp(request, "{\"set\":{\"power\":\"off\"}}"))
		set_power(0);
	else if (!strcmp(request, "{\"set\":{\"power\":\"on\"}}"))
		set_power(1);
	else
		return 0;
	return 1;
}

/* The value that a request asks for, `{"get":"input"}`; whether there is one. */
static int get(const char *request, char *value, size_t size)
{
	if (!strcmp(request, "{\"get\":\"input\"}") && input_is_driven())
		snprintf(value, size, "%u", (unsigned)get_input());
	else if (!strcmp(request, "{\"get\":\"input\"}"))
		snprintf(value, size, "\"wired\"");
	else if (!strcmp(request, "{\"get\":\"power\"}"))
		snprintf(value, size, "\"%s\"", has_power() ? "on" : "off");
	else
		return 0;
	return 1;
}

static void answer(const char *request)
{
	char value[32];

	if (!strcmp(request, "{\"names\":true}"))
		dprintf(client, NAMES "\n");
	else if (get(request, value, sizeof value))
		dprintf(client, "{\"value\":%s}\n", value);
	else if (set(request))
		dprintf(client, "{\"ok\":true}\n");
	else
		dprintf(client, "{\"error\":\"this bench has `power`, on or off, and `input`, "
				"0 to 65535 or wired\"}\n");
}

/* Begins to serve the bench at a path; whether that works. */
int open_bench(const char *path)
{
	struct sockaddr_un address = {.sun_family = AF_UNIX};

	if (strlen(path) >= sizeof address.sun_path)
		return 0;
	strcpy(address.sun_path, path);
	unlink(path);
	listener = socket(AF_UNIX, SOCK_STREAM, 0);
	return listener >= 0 && !bind(listener, (struct sockaddr *)&address, sizeof address) &&
	       !listen(listener, 1);
}

/* What to poll for the next request: a file descriptor, negative when there is no bench. */
int bench_waits_for(void)
{
	return client >= 0 ? client : listener;
}

/* Takes the next byte, and answers a request that it completes. One harness at a time is served. */
void serve_bench(void)
{
	static char request[256];
	static size_t length;
	char byte;

	if (client < 0) {
		client = accept(listener, NULL, NULL);
		length = 0;
	} else if (read(client, &byte, 1) != 1) {
		close(client);
		client = -1;
	} else if (byte != '\n') {
		request[length] = byte;
		length += length < sizeof request - 1;
	} else {
		request[length] = 0;
		length = 0;
		answer(request);
	}
}
