#include "led_frame.h"

#include <string.h>

#include "protocol.h"

#define ALL_SIDES ((1u << SIDES) - 1u)

/* The filter behind the PWM (5 kOhm, 220 nF: 1.1 ms) follows to 1 % in 5 ms; three times that. */
#define LEVEL_SETTLES_MS 15u
/* Below 20 of 256 levels the sense is too small to be judged. */
#define JUDGED_FROM_LEVEL 20u
/* Readings in a row until a side is called open: one alone may be noise, and open only warns. */
#define OPEN_READINGS 3u
#define SHORT_READINGS 2u
/* A quarter of the light that most strips give: enough to sense, and nothing to look into. */
#define SELF_TEST_LEVEL 64u
#define SELF_TEST_FRAMES 16u

static struct {
    volatile uint8_t state;
    volatile uint8_t mask;
    volatile uint16_t faults;
    volatile uint32_t uptime_ms;
    volatile uint32_t frame;
    volatile uint16_t silent_ms;
    volatile uint16_t host_timeout_ms;

    volatile uint8_t pattern[PATTERN_MAX];
    volatile uint8_t pattern_length;
    volatile uint8_t pattern_at;

    uint8_t levels[SIDES];       /* as the host wants them */
    uint8_t level_now[SIDES];    /* as they are applied */
    uint8_t level_lowest[SIDES]; /* of those that may still be flowing */
    uint8_t level_highest[SIDES];
    volatile uint8_t settling_ms;

    volatile uint8_t sensed_side;
    uint8_t open_readings[SIDES];
    uint8_t short_readings[SIDES];
    int16_t temperature_dc;

    volatile uint8_t test_side;
    volatile uint8_t test_frames;
    uint8_t sides_passed;
    bool test_level_applied;
} led;

static void apply_levels(const uint8_t levels[SIDES])
{
    board_lock();
    bool settled = led.settling_ms == 0;
    for (uint8_t side = 0; side < SIDES; side++) {
        uint8_t now = led.level_now[side];
        uint8_t lowest = settled ? now : led.level_lowest[side];
        uint8_t highest = settled ? now : led.level_highest[side];
        led.level_lowest[side] = levels[side] < lowest ? levels[side] : lowest;
        led.level_highest[side] = levels[side] > highest ? levels[side] : highest;
        led.level_now[side] = levels[side];
    }
    led.settling_ms = LEVEL_SETTLES_MS;
    board_unlock();
    board_set_levels(led.level_now);
}

void led_init(uint8_t reset_cause)
{
    memset((void *)&led, 0, sizeof led);
    led.host_timeout_ms = 500;
    led.pattern[0] = ALL_SIDES;
    led.pattern_length = 1;
    led.temperature_dc = 250; /* until the first reading */
    if (reset_cause & RESET_BROWNOUT)
        led.faults |= FAULT_BROWNOUT;
    if (reset_cause & RESET_WATCHDOG)
        led.faults |= FAULT_WATCHDOG_RESET;
    board_light_off();
    apply_levels(led.levels);
    board_set_timing(8333, 400, 20);
}

led_status_t led_status(void)
{
    led_status_t status;
    board_lock();
    status.state = led.state;
    status.faults = led.faults;
    status.uptime_ms = led.uptime_ms;
    status.frame = led.frame;
    status.mask = led.mask;
    board_unlock();
    status.temperature_dc = led.temperature_dc;
    status.sides_passed = led.sides_passed;
    return status;
}

/* After a self test the levels of the host come back. */
static void end_self_test(void)
{
    if (led.test_level_applied && led.state != STATE_SELF_TEST) {
        led.test_level_applied = false;
        apply_levels(led.levels);
    }
}

/* Light goes off first; everything else can wait. */
static void go_dark(uint8_t state)
{
    board_lock();
    board_light_off();
    led.mask = 0;
    led.state = state;
    board_unlock();
}

static void fail_safe(uint16_t fault)
{
    board_lock();
    led.faults |= fault;
    go_dark(STATE_SAFE);
    board_unlock();
}

uint8_t led_set_levels(const uint8_t levels[SIDES])
{
    memcpy(led.levels, levels, SIDES);
    if (!led.test_level_applied)
        apply_levels(led.levels);
    return STATUS_OK;
}

uint8_t led_set_timing(uint16_t period_us, uint16_t strobe_us, int16_t lead_us)
{
    if (period_us < PERIOD_MIN_US || period_us > PERIOD_MAX_US)
        return STATUS_RANGE;
    if (strobe_us < STROBE_MIN_US || strobe_us > STROBE_MAX_US)
        return STATUS_RANGE;
    if ((uint32_t)strobe_us * 100u > (uint32_t)period_us * DUTY_MAX_PERCENT)
        return STATUS_RANGE;
    if (lead_us < -LEAD_MAX_US || lead_us > LEAD_MAX_US)
        return STATUS_RANGE;
    if ((int32_t)strobe_us + lead_us < TRIGGER_MIN_US)
        return STATUS_RANGE;
    board_set_timing(period_us, strobe_us, lead_us);
    return STATUS_OK;
}

static void restart_pattern(void)
{
    led.pattern_at = (uint8_t)(led.pattern_length - 1);
}

uint8_t led_set_pattern(const uint8_t *masks, uint8_t count)
{
    if (count < 1 || count > PATTERN_MAX)
        return STATUS_BAD_LENGTH;
    for (uint8_t i = 0; i < count; i++)
        if (masks[i] & ~ALL_SIDES)
            return STATUS_RANGE;
    board_lock();
    for (uint8_t i = 0; i < count; i++)
        led.pattern[i] = masks[i];
    led.pattern_length = count;
    restart_pattern();
    board_unlock();
    return STATUS_OK;
}

uint8_t led_set_host_timeout(uint16_t timeout_ms)
{
    if (timeout_ms < HOST_TIMEOUT_MIN_MS || timeout_ms > HOST_TIMEOUT_MAX_MS)
        return STATUS_RANGE;
    board_lock();
    led.host_timeout_ms = timeout_ms;
    board_unlock();
    return STATUS_OK;
}

static bool faulted(void)
{
    return (led.faults & FAULTS_DARK) != 0;
}

uint8_t led_arm(void)
{
    uint8_t status = STATUS_OK;
    end_self_test();
    board_lock();
    if (faulted() || board_overcurrent()) {
        status = STATUS_FAULTED;
    } else if (led.state == STATE_SELF_TEST) {
        status = STATUS_BUSY;
    } else if (led.state != STATE_ARMED) {
        restart_pattern();
        led.silent_ms = 0;
        led.state = STATE_ARMED;
    }
    board_unlock();
    return status;
}

uint8_t led_disarm(void)
{
    board_lock();
    if (led.state != STATE_SAFE)
        go_dark(STATE_IDLE);
    board_unlock();
    end_self_test();
    return STATUS_OK;
}

uint8_t led_clear_faults(uint16_t faults)
{
    if ((faults & led.faults & FAULT_OVERTEMPERATURE) && led.temperature_dc >= TEMPERATURE_ON_DC)
        return STATUS_STATE;
    if ((faults & led.faults & FAULT_OVERCURRENT) && board_overcurrent())
        return STATUS_STATE;
    board_lock();
    led.faults &= (uint16_t)~faults;
    if (led.state == STATE_SAFE && !faulted())
        led.state = STATE_IDLE;
    board_unlock();
    for (uint8_t side = 0; side < SIDES; side++) {
        if (faults & FAULT_OPEN(side))
            led.open_readings[side] = 0;
        if (faults & FAULT_SHORT(side))
            led.short_readings[side] = 0;
    }
    return STATUS_OK;
}

uint8_t led_self_test(void)
{
    static const uint8_t levels[SIDES] = {SELF_TEST_LEVEL, SELF_TEST_LEVEL, SELF_TEST_LEVEL,
                                          SELF_TEST_LEVEL};
    if (led.state != STATE_IDLE)
        return STATUS_STATE;
    memset(led.open_readings, 0, SIDES);
    memset(led.short_readings, 0, SIDES);
    led.sides_passed = 0;
    led.test_level_applied = true;
    apply_levels(levels);
    board_lock();
    led.test_side = 0;
    led.test_frames = 0;
    led.silent_ms = 0;
    led.state = STATE_SELF_TEST;
    board_unlock();
    return STATUS_OK;
}

void led_main_loop(void)
{
    end_self_test();
}

void led_host_spoke(void)
{
    board_lock();
    led.silent_ms = 0;
    board_unlock();
}

void led_tick_1ms(void)
{
    led.uptime_ms++;
    if (led.settling_ms)
        led.settling_ms--;
    if (led.silent_ms < UINT16_MAX)
        led.silent_ms++;
    if (board_overcurrent() && !(led.faults & FAULT_OVERCURRENT))
        fail_safe(FAULT_OVERCURRENT);
    bool may_shine = led.state == STATE_ARMED || led.state == STATE_SELF_TEST;
    if (may_shine && led.silent_ms >= led.host_timeout_ms)
        fail_safe(FAULT_HOST_LOST);
}

static uint8_t tested_side(void)
{
    if (led.test_frames == SELF_TEST_FRAMES) {
        led.test_frames = 0;
        led.test_side++;
    }
    led.test_frames++;
    if (led.test_side < SIDES)
        return (uint8_t)(1u << led.test_side);
    led.state = STATE_IDLE;
    return 0;
}

uint8_t led_next_frame(void)
{
    uint8_t mask = 0;
    led.frame++;
    if (led.state == STATE_ARMED) {
        led.pattern_at = (uint8_t)((led.pattern_at + 1) % led.pattern_length);
        mask = led.pattern[led.pattern_at];
    } else if (led.state == STATE_SELF_TEST) {
        mask = tested_side();
    }
    led.mask = mask;
    return mask;
}

void led_overcurrent(void)
{
    fail_safe(FAULT_OVERCURRENT);
}

/* The lit sides take turns, whatever the pattern: a fixed order could miss a side for ever. */
uint8_t led_side_to_sense(void)
{
    for (uint8_t step = 1; step <= SIDES; step++) {
        uint8_t side = (uint8_t)((led.sensed_side + step) % SIDES);
        if (led.mask & (1u << side)) {
            led.sensed_side = side;
            return side;
        }
    }
    return SIDES;
}

static bool reads_open(uint8_t side, uint16_t counts)
{
    uint8_t level = led.settling_ms ? led.level_lowest[side] : led.level_now[side];
    return level >= JUDGED_FROM_LEVEL && counts < level * SENSE_COUNTS_PER_LEVEL / 4u;
}

static bool reads_short(uint8_t side, uint16_t counts)
{
    uint8_t level = led.settling_ms ? led.level_highest[side] : led.level_now[side];
    uint16_t expected = (uint16_t)(level * SENSE_COUNTS_PER_LEVEL);
    return counts > expected + expected / 2u + 30u; /* at most 795 of 1023: within reach */
}

static void count_in_a_row(uint8_t *readings, bool bad)
{
    if (!bad)
        *readings = 0;
    else if (*readings < UINT8_MAX)
        (*readings)++;
}

void led_sensed(uint8_t side, uint16_t counts)
{
    if (side >= SIDES)
        return;
    bool open = reads_open(side, counts), shorted = reads_short(side, counts);
    count_in_a_row(&led.open_readings[side], open);
    count_in_a_row(&led.short_readings[side], shorted);
    if (led.open_readings[side] >= OPEN_READINGS) {
        board_lock();
        led.faults |= FAULT_OPEN(side);
        board_unlock();
    }
    if (led.short_readings[side] >= SHORT_READINGS)
        fail_safe(FAULT_SHORT(side));
    if (led.state == STATE_SELF_TEST && !led.settling_ms && side == led.test_side) {
        if (open || shorted)
            led.sides_passed &= (uint8_t)~(1u << side);
        else
            led.sides_passed |= (uint8_t)(1u << side);
    }
}

void led_temperature(int16_t temperature_dc)
{
    led.temperature_dc = temperature_dc;
    if (temperature_dc >= TEMPERATURE_OFF_DC && !(led.faults & FAULT_OVERTEMPERATURE))
        fail_safe(FAULT_OVERTEMPERATURE);
}
