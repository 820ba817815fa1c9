/* A board that only remembers, so that tests can load the core as a library. */
#include "board.h"

#include <string.h>

#include "led_frame.h"
#include "link.h"

static uint8_t sent[65536];
static uint32_t sent_count;
static int lock_depth;
static bool overcurrent;

/* Read by the tests. */
uint8_t host_levels[SIDES];
uint16_t host_period_us, host_strobe_us;
int16_t host_lead_us;
uint32_t host_resets;
uint8_t host_lit; /* the sides that are switched on */
bool host_line_full;

void board_lock(void) { lock_depth++; }
void board_unlock(void) { lock_depth--; }
void board_set_levels(const uint8_t levels[SIDES]) { memcpy(host_levels, levels, SIDES); }
void board_light_off(void) { host_lit = 0; }
bool board_overcurrent(void) { return overcurrent; }
void board_reset(void) { host_resets++; }

void board_set_timing(uint16_t period_us, uint16_t strobe_us, int16_t lead_us)
{
    host_period_us = period_us;
    host_strobe_us = strobe_us;
    host_lead_us = lead_us;
}

bool board_send(const uint8_t *bytes, uint8_t count, bool must)
{
    if ((host_line_full && !must) || sent_count + count > sizeof sent)
        return false;
    memcpy(sent + sent_count, bytes, count);
    sent_count += count;
    return true;
}

void host_start(uint8_t reset_cause, uint16_t boot_id)
{
    sent_count = 0;
    lock_depth = 0;
    host_resets = 0;
    overcurrent = host_line_full = false;
    led_init(reset_cause);
    link_init(reset_cause, boot_id);
}

static void main_loop(void)
{
    led_main_loop();
    link_tell();
}

void host_receive(const uint8_t *bytes, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        link_take(bytes[i]);
    main_loop();
}

void host_pass_ms(uint32_t count)
{
    while (count--)
        led_tick_1ms();
    main_loop();
}

/* One whole period: its sides go on, and one of them is sensed. */
uint8_t host_pass_frame(const uint16_t sense_counts[SIDES])
{
    host_lit = led_next_frame();
    uint8_t side = led_side_to_sense();
    if (side < SIDES)
        led_sensed(side, sense_counts[side]);
    main_loop();
    return side;
}

void host_overcurrent(bool active)
{
    overcurrent = active;
    if (active)
        led_overcurrent();
    main_loop();
}

void host_temperature(int16_t temperature_dc)
{
    led_temperature(temperature_dc);
    main_loop();
}

uint32_t host_take_sent(uint8_t *bytes, uint32_t room)
{
    uint32_t count = sent_count < room ? sent_count : room;
    memcpy(bytes, sent, count);
    sent_count = 0;
    return count;
}

int host_lock_depth(void) { return lock_depth; }
uint8_t host_state(void) { return led_status().state; }
uint16_t host_faults(void) { return led_status().faults; }
uint8_t host_mask(void) { return led_status().mask; }
