/* A CANopen node for a first look at the harness: heartbeat, SDO expedited and segmented, an RPDO,
 * a TPDO and emergency messages. It reads frames from standard input and writes frames to standard
 * output, a line each in the form of candump's logs; a port to a board replaces `send` and `main`.
 *
 * OVERFLOW and STALE_LENGTH compile a defect in; see README.md. */

#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "bench.h"

/* ---- The object dictionary ---- */

enum { RO, RW };
enum { TEXT_SIZE = 32 };
enum state { INITIALISING = 0, STOPPED = 4, OPERATIONAL = 5, PRE_OPERATIONAL = 127 };

static uint32_t node = 5;
static enum state state;

static uint8_t error_register, simulated_fault, rpdo_type, tpdo_type;
static uint16_t heartbeat_time, output, input, inhibit_time, event_time;
static uint32_t emergency_id, rpdo_id, tpdo_id;
static char text[TEXT_SIZE];
static uint32_t text_length;

static const uint32_t device_type = 0, vendor = 0x7FFFFFFE, product = 1, revision = 0x00010000,
                      serial = 1, rpdo_object = 0x20000010, tpdo_object = 0x20010010;
static const uint8_t four = 4, two = 2, five = 5, one = 1;

struct entry {
    uint16_t index;
    uint8_t sub, access;
    uint32_t size;
    const void *value;
};

static const struct entry entries[] = {
    {0x1000, 0, RO, 4, &device_type},
    {0x1001, 0, RO, 1, &error_register},
    {0x1014, 0, RO, 4, &emergency_id},
    {0x1017, 0, RW, 2, &heartbeat_time},
    {0x1018, 0, RO, 1, &four},
    {0x1018, 1, RO, 4, &vendor},
    {0x1018, 2, RO, 4, &product},
    {0x1018, 3, RO, 4, &revision},
    {0x1018, 4, RO, 4, &serial},
    {0x1400, 0, RO, 1, &two},
    {0x1400, 1, RW, 4, &rpdo_id},
    {0x1400, 2, RW, 1, &rpdo_type},
    {0x1600, 0, RO, 1, &one},
    {0x1600, 1, RO, 4, &rpdo_object},
    {0x1800, 0, RO, 1, &five},
    {0x1800, 1, RW, 4, &tpdo_id},
    {0x1800, 2, RW, 1, &tpdo_type},
    {0x1800, 3, RW, 2, &inhibit_time},
    {0x1800, 5, RW, 2, &event_time},
    {0x1A00, 0, RO, 1, &one},
    {0x1A00, 1, RO, 4, &tpdo_object},
    {0x2000, 0, RW, 2, &output},
    {0x2001, 0, RO, 2, &input},
    {0x2002, 0, RW, TEXT_SIZE, text},
    {0x2003, 0, RW, 1, &simulated_fault},
};

enum {
    TOGGLE = 0x05030000,
    NO_COMMAND = 0x05040001,
    READ_ONLY = 0x06010002,
    NO_OBJECT = 0x06020000,
    WRONG_LENGTH = 0x06070010,
    TOO_LONG = 0x06070012,
    TOO_SHORT = 0x06070013,
    NO_SUB_INDEX = 0x06090011,
    WRONG_VALUE = 0x06090030,
    TOO_HIGH = 0x06090031,
};

static uint32_t find(uint16_t index, uint8_t sub, const struct entry **found) {
    uint32_t code = NO_OBJECT;
    for (size_t place = 0; place < sizeof entries / sizeof *entries; place++) {
        if (entries[place].index == index) {
            code = NO_SUB_INDEX;
            if (entries[place].sub == sub) {
                *found = &entries[place];
                return 0;
            }
        }
    }
    return code;
}

static uint32_t number(const uint8_t *bytes, uint32_t size) {
    uint32_t value = 0;
    for (uint32_t place = 0; place < size; place++)
        value |= (uint32_t)bytes[place] << 8 * place;
    return value;
}

/* ---- Time and frames ---- */

static uint64_t now; /* in microseconds */
static uint64_t boot_at, heartbeat_at, event_at, inhibited_until;
static int tpdo_waits;

static uint64_t clock_us(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (uint64_t)time.tv_sec * 1000000 + (uint64_t)time.tv_nsec / 1000;
}

static void send(uint32_t id, const uint8_t *data, uint32_t length) {
    printf("(%.6f) can0 %03X#", (double)now / 1e6, (unsigned)id);
    for (uint32_t place = 0; place < length; place++)
        printf("%02X", data[place]);
    putchar('\n');
    fflush(stdout);
}

static void send_heartbeat(uint8_t value) { send(0x700 + node, &value, 1); }

static void send_tpdo(void) {
    uint8_t data[2] = {(uint8_t)input, (uint8_t)(input >> 8)};
    if (state != OPERATIONAL || tpdo_id >> 31)
        return;
    if (now < inhibited_until) {
        tpdo_waits = 1;
        return;
    }
    tpdo_waits = 0;
    inhibited_until = now + inhibit_time * 100u;
    event_at = now + event_time * 1000u;
    send(tpdo_id & 0x7FF, data, 2);
}

/* ---- Errors ---- */

enum { GENERIC = 0x01, COMMUNICATION = 0x10 };

/* An error begins or ends: the bit of 1001h and an emergency message. */
static void set_error(uint8_t bit, uint16_t code, int present) {
    if (!(error_register & bit) == !present)
        return;
    /* The generic bit is set while there is any error. */
    error_register = present ? error_register | bit | GENERIC : error_register & ~bit;
    if (!(error_register & ~GENERIC) && !simulated_fault)
        error_register = 0;
    uint16_t sent = present ? code : 0;
    uint8_t data[8] = {(uint8_t)sent, (uint8_t)(sent >> 8), error_register};
    if (state != STOPPED)
        send(emergency_id, data, 8);
}

/* ---- The application ---- */

/* The input is wired to the output, unless the bench drives it. */
static int driven;
static uint16_t level;

static void follow_input(void) {
    uint16_t value = driven ? level : output;
    if (input != value) {
        input = value;
        send_tpdo();
    }
}

static void set_output(uint16_t value) {
    output = value;
    follow_input();
}

void drive_input(uint16_t value) {
    driven = 1;
    level = value;
    follow_input();
}

void wire_input(void) {
    driven = 0;
    follow_input();
}

int input_is_driven(void) { return driven; }

uint16_t get_input(void) { return input; }

/* ---- SDO ---- */

static struct {
    enum { NOTHING, DOWNLOAD, UPLOAD } kind;
    const struct entry *entry;
    uint8_t toggle;
    uint32_t length, announced, place;
    uint8_t buffer[TEXT_SIZE];
} transfer;

static void answer(uint8_t command, const uint8_t *mux, uint32_t value) {
    uint8_t data[8] = {command, mux[0], mux[1], mux[2], (uint8_t)value, (uint8_t)(value >> 8),
                       (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    send(0x580 + node, data, 8);
}

static void refuse(const uint8_t *mux, uint32_t code) {
    transfer.kind = NOTHING;
    answer(0x80, mux, code);
}

/* Identifiers that are free for PDOs (CiA 301, table of restricted identifiers). */
static int is_free(uint32_t id) {
    return (id > 0x180 && id < 0x581) || (id >= 0x680 && id < 0x6E0);
}

static uint32_t check_id(uint32_t old, uint32_t value) {
    uint32_t id = value & 0x7FF, is_valid = !(value >> 31), was_valid = !(old >> 31);
    if (value & 0x3FFFF800)
        return WRONG_VALUE;
    /* The identifier of a PDO that exists stays. */
    if (is_valid && was_valid && id != (old & 0x7FF))
        return WRONG_VALUE;
    return is_valid && !is_free(id) ? WRONG_VALUE : 0;
}

static uint32_t check(const struct entry *entry, const uint8_t *bytes, uint32_t length) {
    if (entry->value == text)
        return length > TEXT_SIZE ? TOO_LONG : 0;
    if (length != entry->size)
        return length > entry->size ? TOO_LONG : TOO_SHORT;
    uint32_t value = number(bytes, length);
    if (entry->value == &rpdo_id)
        return check_id(rpdo_id, value);
    if (entry->value == &tpdo_id)
        return check_id(tpdo_id, value);
    if (entry->value == &rpdo_type || entry->value == &tpdo_type)
        return value < 254 ? WRONG_VALUE : 0;
    /* The inhibit time of a PDO that exists stays. */
    if (entry->value == &inhibit_time)
        return tpdo_id >> 31 || value == inhibit_time ? 0 : WRONG_VALUE;
    return entry->value == &simulated_fault && value > 1 ? TOO_HIGH : 0;
}

static uint32_t store(const struct entry *entry, const uint8_t *bytes, uint32_t length) {
    uint32_t code = check(entry, bytes, length);
    if (code)
        return code;
    if (entry->value == &output) {
        set_output((uint16_t)number(bytes, 2));
        return 0;
    }
    memcpy((void *)entry->value, bytes, length);
    if (entry->value == text) {
#ifdef STALE_LENGTH
        text_length = length > text_length ? length : text_length;
#else
        text_length = length;
#endif
    }
    if (entry->value == &heartbeat_time)
        heartbeat_at = now + heartbeat_time * 1000u;
    if (entry->value == &event_time)
        event_at = now + event_time * 1000u;
    if (entry->value == &simulated_fault)
        set_error(0x02, 0x2000, simulated_fault);
    return 0;
}

static void upload(const uint8_t *request) {
    const uint8_t *mux = request + 1;
    const struct entry *entry;
    uint32_t code = find((uint16_t)number(mux, 2), mux[2], &entry);
    if (code) {
        refuse(mux, code);
        return;
    }
    uint32_t size = entry->value == text ? text_length : entry->size;
    transfer.kind = NOTHING;
    if (size > 0 && size <= 4) {
        answer((uint8_t)(0x43 | (4 - size) << 2), mux, number(entry->value, size));
        return;
    }
    transfer.kind = UPLOAD;
    transfer.entry = entry;
    transfer.toggle = 0;
    transfer.place = 0;
    transfer.length = size;
    memcpy(transfer.buffer, entry->value, size);
    answer(0x41, mux, size);
}

static void download(const uint8_t *request) {
    const uint8_t *mux = request + 1;
    const struct entry *entry;
    uint32_t code = find((uint16_t)number(mux, 2), mux[2], &entry);
    if (!code && entry->access == RO)
        code = READ_ONLY;
    uint32_t length = number(request + 4, 4);
    if (!code && request[0] & 2) { /* expedited */
        length = request[0] & 1 ? 4u - (request[0] >> 2 & 3) : entry->size;
        code = length > 4 ? WRONG_LENGTH : store(entry, request + 4, length);
    } else if (!code) {
        transfer.announced = request[0] & 1 ? length : UINT32_MAX;
        if (transfer.announced != UINT32_MAX && length > entry->size)
            code = TOO_LONG;
    }
    if (code) {
        refuse(mux, code);
        return;
    }
    transfer.kind = request[0] & 2 ? NOTHING : DOWNLOAD;
    transfer.entry = entry;
    transfer.toggle = 0;
    transfer.length = 0;
    answer(0x60, mux, 0);
}

static void segment(const uint8_t *request) {
    const struct entry *entry = transfer.entry;
    uint8_t none[3] = {0, 0, 0}, mux[3], data[8] = {0};
    if (transfer.kind == NOTHING) {
        refuse(none, NO_COMMAND);
        return;
    }
    mux[0] = (uint8_t)entry->index, mux[1] = (uint8_t)(entry->index >> 8), mux[2] = entry->sub;
    int is_upload = request[0] >> 5 == 3;
    uint32_t code = is_upload == (transfer.kind == UPLOAD) ? 0 : NO_COMMAND;
    if (!code && (request[0] >> 4 & 1) != transfer.toggle)
        code = TOGGLE;
    if (code) {
        refuse(mux, code);
        return;
    }
    if (is_upload) {
        uint32_t left = transfer.length - transfer.place, size = left < 7 ? left : 7;
        int last = size == left;
        data[0] = (uint8_t)((uint32_t)transfer.toggle << 4 | (7 - size) << 1 | (last ? 1u : 0u));
        memcpy(data + 1, transfer.buffer + transfer.place, size);
        transfer.place += size;
        transfer.kind = last ? NOTHING : UPLOAD;
    } else {
        uint32_t size = 7 - (request[0] >> 1 & 7), length = transfer.length + size;
        int last = request[0] & 1;
        data[0] = (uint8_t)(0x20 | transfer.toggle << 4);
#ifndef OVERFLOW
        if (length > entry->size || length > transfer.announced)
            code = TOO_LONG;
#endif
        if (!code)
            memcpy(transfer.buffer + transfer.length, request + 1, size);
        transfer.length = length;
        if (!code && last && transfer.announced != UINT32_MAX && length < transfer.announced)
            code = TOO_SHORT;
        if (!code && last)
            code = store(entry, transfer.buffer, length);
        if (code) {
            refuse(mux, code);
            return;
        }
        transfer.kind = last ? NOTHING : DOWNLOAD;
    }
    transfer.toggle ^= 1;
    send(0x580 + node, data, 8);
}

static void serve_sdo(const uint8_t *request) {
    switch (request[0] >> 5) {
    case 1:
        download(request);
        break;
    case 2:
        upload(request);
        break;
    case 0:
    case 3:
        segment(request);
        break;
    case 4:
        transfer.kind = NOTHING;
        break;
    default:
        refuse(request + 1, NO_COMMAND);
    }
}

/* ---- NMT ---- */

static void reset_communication(void) {
    emergency_id = 0x80 + node;
    rpdo_id = 0x200 + node;
    tpdo_id = 0x180 + node;
    rpdo_type = tpdo_type = 255;
    heartbeat_time = inhibit_time = event_time = 0;
    error_register &= (uint8_t)~COMMUNICATION;
    if (error_register == GENERIC)
        error_register = 0;
    transfer.kind = NOTHING;
    inhibited_until = 0;
    tpdo_waits = 0;
    state = INITIALISING;
    boot_at = now + 5000;
}

static void reset_node(void) {
    output = 0;
    input = driven ? level : 0;
    simulated_fault = error_register = 0;
    text_length = 10;
    memcpy(text, "firmware-c", text_length);
    reset_communication();
}

static void obey(uint8_t command) {
    if (state == INITIALISING)
        return;
    switch (command) {
    case 1:
        if (state != OPERATIONAL)
            event_at = now + event_time * 1000u;
        state = OPERATIONAL;
        break;
    case 2:
        state = STOPPED;
        break;
    case 128:
        state = PRE_OPERATIONAL;
        break;
    case 129:
        reset_node();
        break;
    case 130:
        reset_communication();
        break;
    }
    if (state != OPERATIONAL)
        tpdo_waits = 0;
    if (state == STOPPED)
        transfer.kind = NOTHING;
}

/* ---- The loop ---- */

static void receive(uint32_t id, const uint8_t *data, uint32_t length) {
    if (id == 0 && length == 2 && (data[1] == 0 || data[1] == node))
        obey(data[0]);
    else if (id == 0x600 + node && length == 8 && state > STOPPED)
        serve_sdo(data);
    else if (id == (rpdo_id & 0x7FF) && !(rpdo_id >> 31) && state == OPERATIONAL) {
        if (length >= 2)
            set_output((uint16_t)number(data, 2));
        set_error(COMMUNICATION, 0x8210, length < 2);
    }
}

/* A remote request of the TPDO; bit 30 of its COB-ID forbids them. */
static void request(uint32_t id) {
    if (id == (tpdo_id & 0x7FF) && !(tpdo_id >> 30))
        send_tpdo();
}

/* A line of candump: `(0.001000) can0 605#4000100000000000`. Identifiers of 29 bits are not for this
 * node. */
static void read_line(const char *line) {
    uint8_t data[8];
    uint32_t length = 0;
    const char *frame = strrchr(line, ' '), *hash = strchr(line, '#');
    if (!frame || !hash || hash - frame != 4)
        return;
    uint32_t id = (uint32_t)strtoul(frame, NULL, 16);
    if (hash[1] == 'R') {
        request(id);
        return;
    }
    unsigned byte;
    for (const char *hex = hash + 1; length < 8 && sscanf(hex, "%2x", &byte) == 1; hex += 2)
        data[length++] = (uint8_t)byte;
    receive(id, data, length);
}

static int powered = 1;

int has_power(void) { return powered; }

void set_power(int on) {
    if (on && !powered)
        reset_node();
    else if (!on)
        state = INITIALISING;
    powered = on;
}

/* What is due by time, and the milliseconds until the next of it. */
static int work(void) {
    if (state == INITIALISING) {
        if (now < boot_at)
            return (int)((boot_at - now + 999) / 1000);
        send_heartbeat(INITIALISING);
        state = PRE_OPERATIONAL;
    }
    uint64_t next = now + 1000000;
    if (heartbeat_time && now >= heartbeat_at) {
        heartbeat_at += heartbeat_time * 1000u;
        send_heartbeat((uint8_t)state);
    }
    if (state == OPERATIONAL && event_time && now >= event_at) {
        event_at = now + event_time * 1000u;
        send_tpdo();
    }
    if (tpdo_waits && now >= inhibited_until)
        send_tpdo();
    if (heartbeat_time && heartbeat_at < next)
        next = heartbeat_at;
    if (state == OPERATIONAL && event_time && event_at < next)
        next = event_at;
    if (tpdo_waits && inhibited_until < next)
        next = inhibited_until;
    return next > now ? (int)((next - now + 999) / 1000) : 0;
}

int main(int count, char **arguments) {
    char line[128];
    uint32_t length = 0;
    const char *path = getenv("BENCH");
    if (count > 1)
        node = (uint32_t)strtoul(arguments[1], NULL, 0);
    if (path && !open_bench(path)) {
        perror(path);
        return 1;
    }
    now = clock_us();
    reset_node();
    for (;;) {
        now = clock_us();
        int wait = powered ? work() : -1;
        struct pollfd in[2] = {{.fd = 0, .events = POLLIN},
                               {.fd = bench_waits_for(), .events = POLLIN}};
        if (poll(in, 2, wait) <= 0)
            continue;
        now = clock_us();
        if (in[1].revents)
            serve_bench();
        if (!in[0].revents)
            continue;
        char byte;
        if (read(0, &byte, 1) != 1)
            return 0;
        if (byte != '\n') {
            if (length < sizeof line - 1)
                line[length++] = byte;
            continue;
        }
        line[length] = 0;
        length = 0;
        if (powered)
            read_line(line);
    }
}
