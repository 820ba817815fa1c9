/* In every strobe one lit side is measured, then the temperature.
 *
 * The ADC runs at 125 kHz: it holds its input 12 us after the start and converts in 104 us.
 */
#include "sensing.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdbool.h>
#include <util/atomic.h>

#include "led_frame.h"
#include "pins.h"

#define HOLD_US 16u /* 1.5 cycles of the ADC, and two of its prescaler */
#define SUPPLY_MV 5000
#define TMP36_AT_0_C_MV 500 /* and 10 mV a degree */

static volatile uint8_t measuring_side; /* SIDES: the temperature */
static volatile uint8_t sensed_side;
static volatile uint16_t sensed_counts, temperature_counts;
static volatile bool is_sensed, is_temperature;

static void measure(uint8_t side)
{
    measuring_side = side;
    ADMUX = (uint8_t)(_BV(REFS0) | (side < SIDES ? side : TEMPERATURE_CHANNEL));
    ADCSRA |= _BV(ADSC);
}

void sensing_init(void)
{
    DIDR0 = 0x1F;
    ADCSRA = _BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
}

void sensing_strobe(uint8_t side, uint16_t left_us)
{
    if (ADCSRA & _BV(ADSC))
        return;
    measure(left_us > HOLD_US ? side : SIDES);
}

ISR(ADC_vect)
{
    if (measuring_side == SIDES) {
        temperature_counts = ADC;
        is_temperature = true;
        return;
    }
    sensed_side = measuring_side;
    sensed_counts = ADC;
    is_sensed = true;
    measure(SIDES);
}

void sensing_tell(void)
{
    uint8_t side = SIDES;
    uint16_t counts = 0;
    bool warm = false;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (is_sensed) {
            side = sensed_side;
            counts = sensed_counts;
        } else if (is_temperature) {
            counts = temperature_counts;
            warm = true;
            is_temperature = false;
        }
        is_sensed = false;
    }
    if (side < SIDES)
        led_sensed(side, counts);
    else if (warm)
        led_temperature((int16_t)((int32_t)counts * SUPPLY_MV / 1024 - TMP36_AT_0_C_MV));
}
