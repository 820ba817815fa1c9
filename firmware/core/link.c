#include "link.h"

#include <string.h>

#include "board.h"
#include "framing.h"
#include "led_frame.h"
#include "little_endian.h"
#include "protocol.h"
#include "requests.h"

#define RESPONSE_MAX (HEADER_BYTES + PAYLOAD_MAX)

static struct {
    unframer_t unframer;
    line_t line;

    /* The last request and its response: when it comes again, the response got lost. */
    bool answered;
    uint8_t request_sequence;
    uint16_t request_crc;
    uint8_t response[RESPONSE_MAX];
    uint8_t response_length;

    uint8_t event_sequence;
    uint16_t told_faults;
    uint8_t told_state;
    uint32_t told_frame;
} host;

static bool send_message(const uint8_t *message, uint8_t count, bool must)
{
    uint8_t wire[WIRE_MAX];
    uint8_t length = frame_message(message, count, wire);
    return board_send(wire, length, must);
}

static bool send_event(uint8_t event, const uint8_t *payload, uint8_t count, bool must)
{
    uint8_t message[HEADER_BYTES + 16];
    message[0] = KIND_EVENT | PROTOCOL_MAJOR;
    message[1] = host.event_sequence;
    message[2] = event;
    memcpy(message + HEADER_BYTES, payload, count);
    if (!send_message(message, (uint8_t)(HEADER_BYTES + count), must))
        return false;
    host.event_sequence++;
    return true;
}

void link_init(uint8_t reset_cause, uint16_t boot_id)
{
    uint8_t payload[3] = {reset_cause};
    memset(&host, 0, sizeof host);
    unframer_init(&host.unframer);
    host.line.reset_cause = reset_cause;
    host.line.boot_id = boot_id;
    put_u16(payload + 1, boot_id);
    send_event(EVENT_BOOT, payload, sizeof payload, true);
}

/* A host that starts anew may count its requests as the one before it did: HELLO always runs. */
static bool is_repeat(uint8_t sequence, uint8_t op, uint16_t crc)
{
    return host.answered && op != REQUEST_HELLO && sequence == host.request_sequence &&
           crc == host.request_crc;
}

static void answer_request(const uint8_t *message, uint8_t length)
{
    uint8_t sequence = message[1], op = message[2], answer_count = 0;
    uint16_t crc = (uint16_t)((uint16_t)message[length - 2] << 8 | message[length - 1]);
    if (is_repeat(sequence, op, crc)) {
        host.line.repeated++;
    } else {
        uint8_t *response = host.response;
        uint8_t payload_count = (uint8_t)(length - HEADER_BYTES - CRC_BYTES);
        response[0] = KIND_RESPONSE | PROTOCOL_MAJOR;
        response[1] = sequence;
        response[2] = op;
        if (op != REQUEST_HELLO && (message[0] & VERSION_BITS) != PROTOCOL_MAJOR)
            response[3] = STATUS_VERSION;
        else
            response[3] = run_request(&host.line, op, message + HEADER_BYTES, payload_count,
                                      response + HEADER_BYTES + 1, &answer_count);
        host.response_length = (uint8_t)(HEADER_BYTES + 1 + answer_count);
        host.request_sequence = sequence;
        host.request_crc = crc;
        host.answered = true;
    }
    send_message(host.response, host.response_length, true);
}

void link_take(uint8_t byte)
{
    const uint8_t *message = host.unframer.bytes;
    switch (unframer_take(&host.unframer, byte)) {
    case FRAME_NONE:
        break;
    case FRAME_BAD_CRC:
        host.line.bad_crc++;
        break;
    case FRAME_MALFORMED:
        host.line.malformed++;
        break;
    case FRAME_TOO_LONG:
        host.line.too_long++;
        break;
    case FRAME_MESSAGE:
        if ((message[0] & KIND_BITS) != KIND_REQUEST) {
            host.line.malformed++; /* an echo of our own, for instance */
        } else {
            led_host_spoke();
            answer_request(message, host.unframer.length);
        }
    }
}

void link_lost_bytes(uint8_t count)
{
    host.line.too_long = (uint16_t)(host.line.too_long + count);
}

static void tell_faults(const led_status_t *status)
{
    uint8_t payload[9];
    put_u16(payload, status->faults);
    put_u16(payload + 2, status->faults ^ host.told_faults);
    put_u32(payload + 4, status->uptime_ms);
    payload[8] = status->state;
    if (send_event(EVENT_FAULT, payload, sizeof payload, false))
        host.told_faults = status->faults;
}

static void tell_state(const led_status_t *status)
{
    bool tested = host.told_state == STATE_SELF_TEST;
    uint8_t payload[3] = {status->state, host.told_state, status->sides_passed};
    if (send_event(tested ? EVENT_SELF_TEST : EVENT_STATE, payload, sizeof payload, false))
        host.told_state = status->state;
}

static void tell_frame(const led_status_t *status)
{
    uint8_t payload[9];
    host.told_frame = status->frame;
    put_u32(payload, status->frame);
    payload[4] = status->mask;
    put_u32(payload + 5, status->uptime_ms);
    send_event(EVENT_FRAME, payload, sizeof payload, false);
}

void link_tell(void)
{
    led_status_t status = led_status();
    uint8_t every = host.line.report_every;
    if (status.faults != host.told_faults)
        tell_faults(&status);
    if (status.state != host.told_state)
        tell_state(&status);
    if (every && status.frame != host.told_frame && status.frame % every == 0)
        tell_frame(&status);
}
