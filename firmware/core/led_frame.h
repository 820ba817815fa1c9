/* The LED frame: which sides shine in which period, and when none may.
 *
 * There is one LED frame in a controller.  Functions marked (interrupt) may be called from
 * interrupts; all others from the main loop.
 */
#ifndef LED_FRAME_H
#define LED_FRAME_H
#include <stdbool.h>
#include <stdint.h>

#include "board.h"

/* Limits that no host can exceed; firmware/README.md has the eye safety that rests on them. */
#define PERIOD_MIN_US 4000u
#define PERIOD_MAX_US 32000u
#define STROBE_MIN_US 50u /* the current is sensed within the strobe: 12 us of hold, and settling */
#define STROBE_MAX_US 2000u
#define DUTY_MAX_PERCENT 20u
#define LEAD_MAX_US 1000
#define TRIGGER_MIN_US 10
#define HOST_TIMEOUT_MIN_MS 50u
#define HOST_TIMEOUT_MAX_MS 5000u
#define TEMPERATURE_OFF_DC 800 /* tenths of a degree Celsius */
#define TEMPERATURE_ON_DC 700
#define PATTERN_MAX 8

/* The current sense gives half of the level's voltage: 2 of 1024 counts for each of 256 levels. */
#define SENSE_COUNTS_PER_LEVEL 2u

typedef enum { STATE_IDLE = 0, STATE_ARMED = 1, STATE_SAFE = 2, STATE_SELF_TEST = 3 } state_t;

#define FAULT_OVERCURRENT 0x0001u
#define FAULT_OVERTEMPERATURE 0x0002u
#define FAULT_HOST_LOST 0x0004u
#define FAULT_BROWNOUT 0x0008u
#define FAULT_WATCHDOG_RESET 0x0010u
#define FAULT_OPEN(side) ((uint16_t)(0x0100u << (side)))
#define FAULT_SHORT(side) ((uint16_t)(0x1000u << (side)))
/* These keep the frame dark until they are cleared; the others warn. */
#define FAULTS_DARK (FAULT_OVERCURRENT | FAULT_OVERTEMPERATURE | FAULT_HOST_LOST | 0xF000u)

/* Why the controller started: bits as the ATmega's MCUSR has them. */
#define RESET_POWER_ON 0x01u
#define RESET_EXTERNAL 0x02u
#define RESET_BROWNOUT 0x04u
#define RESET_WATCHDOG 0x08u

/* What is reported; a copy taken at one instant. */
typedef struct {
    uint8_t state;
    uint16_t faults;
    uint32_t uptime_ms;
    uint32_t frame; /* periods since the start */
    uint8_t mask;   /* sides that shine in this period */
    int16_t temperature_dc;
    uint8_t sides_passed; /* by the last self test */
} led_status_t;

void led_init(uint8_t reset_cause);
led_status_t led_status(void);

/* What the host asks; each returns a STATUS_ of protocol.h. */
uint8_t led_set_levels(const uint8_t levels[SIDES]);
uint8_t led_set_timing(uint16_t period_us, uint16_t strobe_us, int16_t lead_us);
uint8_t led_set_pattern(const uint8_t *masks, uint8_t count);
uint8_t led_set_host_timeout(uint16_t timeout_ms);
uint8_t led_arm(void);
uint8_t led_disarm(void);
uint8_t led_clear_faults(uint16_t faults);
uint8_t led_self_test(void);

/* What happens. */
void led_main_loop(void); /* called in every turn of the main loop */
void led_host_spoke(void);
void led_tick_1ms(void);             /* (interrupt) */
uint8_t led_next_frame(void);        /* (interrupt) a period begins; returns the sides to switch on */
void led_overcurrent(void);          /* (interrupt) */
uint8_t led_side_to_sense(void);     /* (interrupt) a strobe has begun; SIDES if there is none */
void led_sensed(uint8_t side, uint16_t counts); /* of 1024, taken while the side shone */
void led_temperature(int16_t temperature_dc);

#endif
