/* ATmega328P at 16 MHz, Arduino Uno or Nano; pins.h says what is connected where. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>

#include "board.h"
#include "identity.h"
#include "led_frame.h"
#include "link.h"
#include "pins.h"
#include "sensing.h"
#include "serial.h"
#include "strobe.h"

static uint8_t reset_cause __attribute__((section(".noinit")));
static uint8_t lock_depth, status_before_lock;
static volatile bool reset_wanted;

/* Runs before main: after a watchdog reset the watchdog is still on, at 16 ms.  Optiboot clears MCUSR
 * and hands its value on in r2. */
void keep_reset_cause(void) __attribute__((naked, used, section(".init3")));
void keep_reset_cause(void)
{
    uint8_t from_bootloader;
    __asm__ volatile("mov %0, r2" : "=r"(from_bootloader));
    reset_cause = MCUSR ? MCUSR : (uint8_t)(from_bootloader & 0x0F);
    MCUSR = 0;
    wdt_disable();
}

void board_lock(void)
{
    uint8_t status = SREG;
    cli();
    if (lock_depth++ == 0)
        status_before_lock = status;
}

void board_unlock(void)
{
    if (--lock_depth == 0)
        SREG = status_before_lock;
}

/* PWM at 7.8 kHz; the filter behind it leaves a current that does not beat with the exposures.  Fast
 * PWM still gives one step of 256 at a compare value of 0: a level of 0 takes the pin off the
 * timer, and low it is. */
void board_set_levels(const uint8_t levels[SIDES])
{
    uint8_t mode0 = _BV(WGM01) | _BV(WGM00), mode2 = _BV(WGM21) | _BV(WGM20);
    OCR0A = levels[0];
    OCR0B = levels[1];
    OCR2A = levels[2];
    OCR2B = levels[3];
    if (levels[0])
        mode0 |= _BV(COM0A1);
    if (levels[1])
        mode0 |= _BV(COM0B1);
    if (levels[2])
        mode2 |= _BV(COM2A1);
    if (levels[3])
        mode2 |= _BV(COM2B1);
    TCCR0A = mode0;
    TCCR2A = mode2;
}

bool board_overcurrent(void)
{
    return (PIND & OVERCURRENT_PIN) == 0;
}

bool board_send(const uint8_t *bytes, uint8_t count, bool must)
{
    return serial_send(bytes, count, must);
}

void board_reset(void)
{
    reset_wanted = true;
}

ISR(INT0_vect)
{
    led_overcurrent();
}

/* Timer2 overflows every 128 us. */
ISR(TIMER2_OVF_vect)
{
    static uint16_t passed_us;
    passed_us += 128;
    if (passed_us >= 1000) {
        passed_us -= 1000;
        led_tick_1ms();
    }
}

static void init_levels_and_clock(void)
{
    DDRB |= LEVELS_ON_B | ARMED_LED;
    DDRD |= LEVELS_ON_D;
    TCCR0B = _BV(CS01);
    TCCR2B = _BV(CS21);
    TIMSK2 = _BV(TOIE2);
}

static void init_overcurrent(void)
{
    PORTD |= OVERCURRENT_PIN; /* pulled up: a broken wire is no fault, the driver pulls it down */
    EICRA = _BV(ISC01);
    EIFR = _BV(INTF0);
    EIMSK = _BV(INT0);
}

static void take_from_host(void)
{
    int16_t byte = serial_take();
    while (byte >= 0) {
        link_take((uint8_t)byte);
        byte = serial_take();
    }
    link_lost_bytes(serial_take_lost());
}

static void reset_if_wanted(void)
{
    if (!reset_wanted || !serial_all_sent())
        return;
    cli();
    wdt_enable(WDTO_15MS);
    for (;;) {
    }
}

int main(void)
{
    uint16_t boot_id = identity_count_start();
    led_init(reset_cause);
    init_levels_and_clock();
    init_overcurrent();
    sensing_init();
    serial_init();
    strobe_init();
    wdt_enable(WDTO_250MS);
    sei();
    link_init(reset_cause, boot_id);
    set_sleep_mode(SLEEP_MODE_IDLE);
    for (;;) {
        wdt_reset();
        reset_if_wanted();
        take_from_host();
        sensing_tell();
        led_main_loop();
        link_tell();
        sleep_mode(); /* the clock wakes it after at most 128 us */
    }
}
