/* Timer1 counts half microseconds from 0 to TOP, once a period (mode 14, fast PWM up to ICR1).
 *
 *   OC1A, trigger   ________________________/''''''''''''''''\___
 *   OC1B, strobe    ___________________________/'''''''''''''\___
 *                   0                        A  B          TOP
 *
 * Both rise at their compare values and fall at TOP, without help from the program: the light is as
 * exact as the crystal, and no longer than asked even if the program hangs.  Sides are switched
 * in the overflow interrupt, in the dark just after TOP.
 */
#include "strobe.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "board.h"
#include "led_frame.h"
#include "pins.h"
#include "sensing.h"

#define TICKS_PER_US 2u

typedef struct {
    uint16_t top, strobe_from, trigger_from;
} timing_t;

/* A new timing arrives in two steps, see the overflow interrupt. */
static volatile timing_t wanted;
static volatile bool is_wanted;
static volatile bool top_is_due;
static volatile uint16_t due_top;

static void switch_sides(uint8_t mask)
{
    uint8_t on_b = (uint8_t)(PORTB & ~(BOTTOM_ON | LEFT_ON));
    uint8_t on_d = (uint8_t)(PORTD & ~(TOP_ON | RIGHT_ON));
    if (mask & 1)
        on_d |= TOP_ON;
    if (mask & 2)
        on_d |= RIGHT_ON;
    if (mask & 4)
        on_b |= BOTTOM_ON;
    if (mask & 8)
        on_b |= LEFT_ON;
    PORTB = on_b;
    PORTD = on_d;
}

void board_light_off(void)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { switch_sides(0); }
}

void board_set_timing(uint16_t period_us, uint16_t strobe_us, int16_t lead_us)
{
    uint16_t top = (uint16_t)(period_us * TICKS_PER_US - 1u);
    uint16_t trigger_us = (uint16_t)((int16_t)strobe_us + lead_us);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        wanted.top = top;
        wanted.strobe_from = (uint16_t)(top - strobe_us * TICKS_PER_US);
        wanted.trigger_from = (uint16_t)(top - trigger_us * TICKS_PER_US);
        is_wanted = true;
    }
}

static void start(void)
{
    ICR1 = wanted.top;
    OCR1A = wanted.trigger_from;
    OCR1B = wanted.strobe_from;
    is_wanted = false;
    TCCR1A = _BV(COM1A1) | _BV(COM1A0) | _BV(COM1B1) | _BV(COM1B0) | _BV(WGM11);
    TCCR1B = _BV(WGM13) | _BV(WGM12) | _BV(CS11); /* clock / 8 */
    TIMSK1 = _BV(TOIE1) | _BV(OCIE1B);
}

void strobe_init(void)
{
    DDRB |= TRIGGER_PIN | STROBE_PIN | BOTTOM_ON | LEFT_ON;
    DDRD |= TOP_ON | RIGHT_ON;
    start();
}

/* A period begins.  ICR1 is not buffered, OCR1A and OCR1B are: they take effect at the next TOP.  So
 * the compare values are written in one period and TOP at the beginning of the next, when both
 * belong together; in no period is the strobe longer than its own timing says. */
ISR(TIMER1_OVF_vect)
{
    if (top_is_due) {
        ICR1 = due_top;
        top_is_due = false;
    } else if (is_wanted) {
        OCR1A = wanted.trigger_from;
        OCR1B = wanted.strobe_from;
        due_top = wanted.top;
        top_is_due = true;
        is_wanted = false;
    }
    switch_sides(led_next_frame());
    if (led_status().state == STATE_ARMED)
        PORTB |= ARMED_LED;
    else
        PORTB &= (uint8_t)~ARMED_LED;
}

/* The strobe has begun. */
ISR(TIMER1_COMPB_vect)
{
    uint8_t side = led_side_to_sense();
    uint16_t left = (uint16_t)(ICR1 - TCNT1);
    sensing_strobe(side, left / TICKS_PER_US);
}
