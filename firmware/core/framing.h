/* Messages on a byte stream: COBS between zeros, closed by a CRC.
 *
 * COBS: Cheshire and Baker, "Consistent Overhead Byte Stuffing", 1999.
 * CRC-16/IBM-3740: polynomial 0x1021, start 0xFFFF, high byte first; of "123456789" 0x29B1.
 */
#ifndef FRAMING_H
#define FRAMING_H
#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"

typedef enum { FRAME_NONE, FRAME_MESSAGE, FRAME_BAD_CRC, FRAME_MALFORMED, FRAME_TOO_LONG } framed_t;

/* What has arrived since the last zero.  After FRAME_MESSAGE, `bytes` holds the message with its
 * CRC until the next byte is taken. */
typedef struct {
    uint8_t bytes[MESSAGE_MAX];
    uint8_t length;
    uint8_t run_left; /* bytes until the next code byte */
    bool started;
    bool too_long;
} unframer_t;

uint16_t crc16(const uint8_t *bytes, uint8_t count);

/* Write `count` bytes and their CRC as a frame of at most WIRE_MAX bytes; returns its length.
 * `count` is at most MESSAGE_MAX - CRC_BYTES. */
uint8_t frame_message(const uint8_t *message, uint8_t count, uint8_t wire[WIRE_MAX]);

void unframer_init(unframer_t *unframer);

/* Take one byte from the wire.  A zero ends what was begun, whatever that was. */
framed_t unframer_take(unframer_t *unframer, uint8_t byte);

#endif
