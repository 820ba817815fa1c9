/* libFuzzer: any bytes, and any order of requests and mishaps, keep within the limits. */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "framing.h"
#include "led_frame.h"

void host_start(uint8_t reset_cause, uint16_t boot_id);
void host_receive(const uint8_t *bytes, uint32_t count);
void host_pass_ms(uint32_t count);
uint8_t host_pass_frame(const uint16_t sense_counts[SIDES]);
void host_overcurrent(bool active);
void host_temperature(int16_t temperature_dc);
uint32_t host_take_sent(uint8_t *bytes, uint32_t room);
int host_lock_depth(void);
extern uint8_t host_lit;
extern uint16_t host_period_us, host_strobe_us;
extern int16_t host_lead_us;

static void require(bool holds)
{
    if (!holds)
        abort();
}

static void check_limits(void)
{
    led_status_t status = led_status();
    require(host_lock_depth() == 0);
    require(host_period_us >= PERIOD_MIN_US && host_period_us <= PERIOD_MAX_US);
    require(host_strobe_us <= STROBE_MAX_US);
    require((uint32_t)host_strobe_us * 100u <= (uint32_t)host_period_us * DUTY_MAX_PERCENT);
    require(host_strobe_us + host_lead_us >= TRIGGER_MIN_US);
    if (status.faults & FAULTS_DARK)
        require(status.state == STATE_SAFE);
    if (status.state == STATE_SAFE || status.state == STATE_IDLE)
        require(status.mask == 0 && host_lit == 0);
}

/* Return the byte at `*at` and step on; zero behind the end. */
static uint8_t next(const uint8_t *data, size_t size, size_t *at)
{
    return *at < size ? data[(*at)++] : 0;
}

static void send_request(const uint8_t *data, size_t size, size_t *at, uint8_t sequence)
{
    uint8_t message[MESSAGE_MAX] = {KIND_REQUEST | PROTOCOL_MAJOR, sequence, 0};
    uint8_t wire[WIRE_MAX];
    message[2] = next(data, size, at);
    uint8_t count = next(data, size, at) % (PAYLOAD_MAX + 1);
    for (uint8_t i = 0; i < count; i++)
        message[HEADER_BYTES + i] = next(data, size, at);
    host_receive(wire, frame_message(message, (uint8_t)(HEADER_BYTES + count), wire));
}

static void do_next(const uint8_t *data, size_t size, size_t *at, uint8_t *sequence)
{
    uint16_t counts[SIDES];
    switch (next(data, size, at) % 8) {
    case 0:
        host_pass_ms(next(data, size, at) * 4u);
        break;
    case 1:
        for (uint8_t side = 0; side < SIDES; side++)
            counts[side] = (uint16_t)(next(data, size, at) * 4u);
        host_pass_frame(counts);
        break;
    case 2:
        host_overcurrent(next(data, size, at) & 1);
        break;
    case 3:
        host_temperature((int16_t)(next(data, size, at) * 6 - 400));
        break;
    case 4:
        host_receive(data + *at, (uint32_t)(size - *at < 32 ? size - *at : 32));
        *at += size - *at < 32 ? size - *at : 32;
        break;
    default:
        send_request(data, size, at, (*sequence)++);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t sent[65536];
    size_t at = 0;
    uint8_t sequence = 0;
    host_start(next(data, size, &at), 1);
    while (at < size) {
        do_next(data, size, &at, &sequence);
        check_limits();
        host_take_sent(sent, sizeof sent);
    }
    return 0;
}
