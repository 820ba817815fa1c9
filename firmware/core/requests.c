#include "requests.h"

#include <string.h>

#include "board.h"
#include "led_frame.h"
#include "little_endian.h"
#include "protocol.h"

static uint8_t say_hello(const line_t *line, uint8_t *answer)
{
    answer[0] = PROTOCOL_MAJOR;
    answer[1] = PROTOCOL_MINOR;
    answer[2] = FIRMWARE_MAJOR;
    answer[3] = FIRMWARE_MINOR;
    answer[4] = FIRMWARE_PATCH;
    answer[5] = SIDES;
    answer[6] = PAYLOAD_MAX;
    answer[7] = line->reset_cause;
    put_u16(answer + 8, line->boot_id);
    put_u16(answer + 10, STROBE_MAX_US);
    answer[12] = DUTY_MAX_PERCENT;
    memcpy(answer + 13, "CTLF", 4);
    return 17;
}

static uint8_t say_status(const line_t *line, uint8_t *answer)
{
    led_status_t status = led_status();
    answer[0] = status.state;
    put_u16(answer + 1, status.faults);
    put_u32(answer + 3, status.uptime_ms);
    put_u32(answer + 7, status.frame);
    answer[11] = status.mask;
    put_u16(answer + 12, (uint16_t)status.temperature_dc);
    put_u16(answer + 14, line->bad_crc);
    put_u16(answer + 16, line->malformed);
    put_u16(answer + 18, line->too_long);
    put_u16(answer + 20, line->repeated);
    return 22;
}

/* Return how long the payload of a request must be; ECHO and PATTERN judge it themselves, HELLO may
 * carry what a later host adds. */
static uint8_t payload_length(uint8_t op)
{
    switch (op) {
    case REQUEST_LEVELS:
        return SIDES;
    case REQUEST_TIMING:
        return 6;
    case REQUEST_CLEAR_FAULTS:
    case REQUEST_WATCHDOG:
        return 2;
    case REQUEST_REPORT:
        return 1;
    default:
        return 0;
    }
}

static bool any_length(uint8_t op)
{
    return op == REQUEST_HELLO || op == REQUEST_ECHO || op == REQUEST_PATTERN;
}

static bool known(uint8_t op)
{
    return (op >= REQUEST_HELLO && op <= REQUEST_ECHO) ||
           (op >= REQUEST_LEVELS && op <= REQUEST_REPORT) || op == REQUEST_RESET;
}

uint8_t run_request(line_t *line, uint8_t op, const uint8_t *payload, uint8_t count,
                    uint8_t *answer, uint8_t *answer_count)
{
    *answer_count = 0;
    if (!known(op))
        return STATUS_BAD_OP;
    if (!any_length(op) && count != payload_length(op))
        return STATUS_BAD_LENGTH;
    switch (op) {
    case REQUEST_HELLO:
        *answer_count = say_hello(line, answer);
        return STATUS_OK;
    case REQUEST_STATUS:
        *answer_count = say_status(line, answer);
        return STATUS_OK;
    case REQUEST_ECHO:
        if (count > PAYLOAD_MAX - 1) /* the answer carries a status, too */
            return STATUS_BAD_LENGTH;
        memcpy(answer, payload, count);
        *answer_count = count;
        return STATUS_OK;
    case REQUEST_LEVELS:
        return led_set_levels(payload);
    case REQUEST_TIMING:
        return led_set_timing(get_u16(payload), get_u16(payload + 2),
                              (int16_t)get_u16(payload + 4));
    case REQUEST_PATTERN:
        return led_set_pattern(payload, count);
    case REQUEST_ARM:
        return led_arm();
    case REQUEST_DISARM:
        return led_disarm();
    case REQUEST_CLEAR_FAULTS:
        return led_clear_faults(get_u16(payload));
    case REQUEST_WATCHDOG:
        return led_set_host_timeout(get_u16(payload));
    case REQUEST_SELF_TEST:
        return led_self_test();
    case REQUEST_REPORT:
        line->report_every = payload[0];
        return STATUS_OK;
    default: /* REQUEST_RESET */
        led_disarm();
        board_reset();
        return STATUS_OK;
    }
}
