/* Protocol version 1: the numbers on the wire.  docs/led-frame.md has the tables. */
#ifndef PROTOCOL_H
#define PROTOCOL_H

#define PROTOCOL_MAJOR 1
#define PROTOCOL_MINOR 0
#define FIRMWARE_MAJOR 1
#define FIRMWARE_MINOR 0
#define FIRMWARE_PATCH 0

#define PAYLOAD_MAX 48
#define HEADER_BYTES 3
#define CRC_BYTES 2
#define MESSAGE_MAX (HEADER_BYTES + PAYLOAD_MAX + CRC_BYTES)
/* One code byte suffices for fewer than 254 bytes; a zero before it and a zero after the last. */
#define WIRE_MAX (MESSAGE_MAX + 3)

/* The first byte of a message: kind and major version. */
enum { KIND_REQUEST = 0x00, KIND_RESPONSE = 0x40, KIND_EVENT = 0x80 };
#define KIND_BITS 0xC0
#define VERSION_BITS 0x3F

enum {
    REQUEST_HELLO = 0x01,
    REQUEST_STATUS = 0x02,
    REQUEST_ECHO = 0x03,
    REQUEST_LEVELS = 0x10,
    REQUEST_TIMING = 0x11,
    REQUEST_PATTERN = 0x12,
    REQUEST_ARM = 0x13,
    REQUEST_DISARM = 0x14,
    REQUEST_CLEAR_FAULTS = 0x15,
    REQUEST_WATCHDOG = 0x16,
    REQUEST_SELF_TEST = 0x17,
    REQUEST_REPORT = 0x18,
    REQUEST_RESET = 0x7F
};

enum {
    EVENT_BOOT = 0x40,
    EVENT_FAULT = 0x41,
    EVENT_FRAME = 0x42,
    EVENT_STATE = 0x43,
    EVENT_SELF_TEST = 0x44
};

/* The first byte of a response's payload. */
enum {
    STATUS_OK = 0,
    STATUS_BAD_OP = 1,
    STATUS_BAD_LENGTH = 2,
    STATUS_RANGE = 3,
    STATUS_STATE = 4,
    STATUS_FAULTED = 5,
    STATUS_BUSY = 6,
    STATUS_VERSION = 7
};

#endif
