#include "framing.h"

#include <string.h>

static uint16_t crc16_step(uint16_t crc, uint8_t byte)
{
    crc ^= (uint16_t)((uint16_t)byte << 8);
    for (uint8_t bit = 0; bit < 8; bit++)
        crc = (uint16_t)((uint16_t)(crc << 1) ^ ((crc & 0x8000u) ? 0x1021u : 0u));
    return crc;
}

uint16_t crc16(const uint8_t *bytes, uint8_t count)
{
    uint16_t crc = 0xFFFF;
    while (count--)
        crc = crc16_step(crc, *bytes++);
    return crc;
}

uint8_t frame_message(const uint8_t *message, uint8_t count, uint8_t wire[WIRE_MAX])
{
    uint16_t crc = crc16(message, count);
    uint8_t end[CRC_BYTES] = {(uint8_t)(crc >> 8), (uint8_t)crc};
    uint8_t length = 0;
    wire[length++] = 0;
    uint8_t code_at = length++;
    uint8_t code = 1;
    for (uint8_t i = 0; i < count + CRC_BYTES; i++) {
        uint8_t byte = i < count ? message[i] : end[i - count];
        if (byte) {
            wire[length++] = byte;
            code++;
        } else {
            wire[code_at] = code;
            code_at = length++;
            code = 1;
        }
    }
    wire[code_at] = code;
    wire[length++] = 0;
    return length;
}

void unframer_init(unframer_t *unframer)
{
    memset(unframer, 0, sizeof *unframer);
}

static framed_t judge(const unframer_t *unframer)
{
    if (!unframer->started)
        return FRAME_NONE;
    if (unframer->too_long)
        return FRAME_TOO_LONG;
    if (unframer->run_left || unframer->length < HEADER_BYTES + CRC_BYTES)
        return FRAME_MALFORMED;
    /* The CRC of a message followed by its own CRC is zero. */
    return crc16(unframer->bytes, unframer->length) ? FRAME_BAD_CRC : FRAME_MESSAGE;
}

static void keep(unframer_t *unframer, uint8_t byte)
{
    if (unframer->length < MESSAGE_MAX)
        unframer->bytes[unframer->length++] = byte;
    else
        unframer->too_long = true;
}

framed_t unframer_take(unframer_t *unframer, uint8_t byte)
{
    if (byte == 0) {
        framed_t framed = judge(unframer);
        unframer->started = false;
        unframer->too_long = false;
        unframer->run_left = 0;
        return framed;
    }
    if (!unframer->started) {
        unframer->started = true;
        unframer->length = 0;
        unframer->run_left = (uint8_t)(byte - 1);
    } else if (unframer->run_left == 0) {
        keep(unframer, 0); /* a code byte stands for the zero before it */
        unframer->run_left = (uint8_t)(byte - 1);
    } else {
        keep(unframer, byte);
        unframer->run_left--;
    }
    return FRAME_NONE;
}
