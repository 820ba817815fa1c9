/* The emulated LED frame: see light.h.
 *
 * Copyright (C) 2026 the cornertouchd authors
 *
 * This test program is linked with libsimavr and is, like it, free software under the GNU General
 * Public License, version 3 or later: https://www.gnu.org/licenses/.  It comes WITHOUT ANY WARRANTY.
 * It is no part of cornertouchd, which is under the MIT licence and only talks to it.
 */
#include "light.h"

#include "clock.h"
#include <avr_adc.h>
#include <avr_ioport.h>
#include <avr_timer.h>
#include <sim_io.h>
#include <string.h>

#define CYCLES_PER_US 16.0
#define TCCR1A_ADDRESS 0x80
#define TCCR1B_ADDRESS 0x81
#define ICR1L_ADDRESS 0x86
#define TEMPERATURE_CHANNEL 4
#define SUPPLY_MV 5000
#define FLASHES_KEPT 256u

enum { TRIGGER, STROBE, FIRST_SIDE, PINS = FIRST_SIDE + SIDES };

static avr_t *avr;
static int pin[PINS];
static int level[SIDES];
static int open_mask, short_mask, temperature_mv = 750; /* TMP36 at 25 degrees */
static int lit[SIDES];
static avr_cycle_count_t trigger_at, strobe_at, lit_at[SIDES], last_lit_at;

static struct {
    unsigned long triggers, strobes, dark, lit[SIDES];
    avr_cycle_count_t lit_cycles[SIDES];
    avr_cycle_count_t period_min, period_max, strobe_min, strobe_max;
    long long lead_min, lead_max;
} counts;

/* The last flashes: what shone in each, and when that was. */
static struct {
    int mask, levels[SIDES];
    double at_s;
} flashes[FLASHES_KEPT];
static unsigned long flash_count;

void light_zero(void)
{
    memset(&counts, 0, sizeof counts);
    counts.period_min = counts.strobe_min = ~(avr_cycle_count_t)0;
    counts.lead_min = 1LL << 40;
    counts.lead_max = -counts.lead_min;
}

/* A side shines while the strobe is high, its switch on and its current not zero. */
static void look(void)
{
    for (int side = 0; side < SIDES; side++) {
        int shines = pin[STROBE] && pin[FIRST_SIDE + side] && level[side] > 0;
        if (shines && !lit[side]) {
            lit_at[side] = avr->cycle;
            counts.lit[side]++;
        } else if (!shines && lit[side]) {
            counts.lit_cycles[side] += avr->cycle - lit_at[side];
        }
        if (shines || lit[side])
            last_lit_at = avr->cycle;
        lit[side] = shines;
    }
}

static void trigger_rises(void)
{
    avr_cycle_count_t period = avr->cycle - trigger_at;
    if (counts.triggers++ > 0) {
        counts.period_min = period < counts.period_min ? period : counts.period_min;
        counts.period_max = period > counts.period_max ? period : counts.period_max;
    }
    trigger_at = avr->cycle;
}

static void strobe_rises(void)
{
    long long lead = (long long)avr->cycle - (long long)trigger_at;
    if (pin[TRIGGER]) {
        counts.lead_min = lead < counts.lead_min ? lead : counts.lead_min;
        counts.lead_max = lead > counts.lead_max ? lead : counts.lead_max;
    }
    strobe_at = avr->cycle;
    counts.strobes++;
}

static void keep_flash(void)
{
    unsigned at = flash_count++ % FLASHES_KEPT;
    flashes[at].at_s = clock_of(avr);
    flashes[at].mask = 0;
    for (int side = 0; side < SIDES; side++) {
        flashes[at].mask |= lit[side] << side;
        flashes[at].levels[side] = level[side];
    }
}

static void strobe_falls(void)
{
    keep_flash(); /* before the sides are looked at again: they still shine */
    avr_cycle_count_t length = avr->cycle - strobe_at;
    counts.strobe_min = length < counts.strobe_min ? length : counts.strobe_min;
    counts.strobe_max = length > counts.strobe_max ? length : counts.strobe_max;
}

static void set_pin(int which, int high)
{
    if (pin[which] == high)
        return;
    pin[which] = high;
    if (which == TRIGGER && high)
        trigger_rises();
    if (which == STROBE && high)
        strobe_rises();
    if (which == STROBE && !high)
        strobe_falls();
    look();
    if (which == STROBE && high && !(lit[0] || lit[1] || lit[2] || lit[3]))
        counts.dark++;
}

/* simavr tells compare matches even while the pin is off the timer. */
static void on_compare(struct avr_irq_t *irq, uint32_t value, void *which)
{
    (void)irq;
    int shift = (long)which == TRIGGER ? 6 : 4;
    int connected = avr->data[TCCR1A_ADDRESS] >> shift & 3;
    set_pin((int)(long)which, connected ? (int)(value & 1) : 0);
}

static void on_switch(struct avr_irq_t *irq, uint32_t value, void *which)
{
    (void)irq;
    set_pin((int)(long)which, (int)(value & 1));
}

static void on_level(struct avr_irq_t *irq, uint32_t value, void *side)
{
    (void)irq;
    level[(long)side] = (int)value;
    look();
}

/* The sense gives half of the level's voltage while current flows. */
static int sense_mv(int side)
{
    if ((short_mask >> side & 1) && lit[side])
        return SUPPLY_MV - 200;
    if (!lit[side] || (open_mask >> side & 1))
        return 0;
    return level[side] * SUPPLY_MV / 256 / 2;
}

static void on_conversion(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)unused;
    union {
        avr_adc_mux_t mux;
        uint32_t value;
    } asked = {.value = value};
    int channel = asked.mux.src;
    int mv = channel < SIDES ? sense_mv(channel) : channel == TEMPERATURE_CHANNEL ? temperature_mv : 0;
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0 + channel), (uint32_t)mv);
}

static void write_control(uint8_t value)
{
    avr_io_addr_t control = AVR_DATA_TO_IO(TCCR1B_ADDRESS);
    avr->io[control].w.c(avr, TCCR1B_ADDRESS, value, avr->io[control].w.param);
}

/* simavr looks at compare values and TOP only when a control register of the timer changes.  The
 * firmware writes TOP last, in the interrupt that begins a period, when the compare values have just
 * taken effect: the timer is stopped and started then, and begins that period anew. */
static void on_top(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)value;
    (void)unused;
    static unsigned known;
    unsigned top = avr->data[ICR1L_ADDRESS] | (unsigned)avr->data[ICR1L_ADDRESS + 1] << 8;
    if (top == known) /* it was read, not written */
        return;
    known = top;
    uint8_t control = avr->data[TCCR1B_ADDRESS];
    write_control(0);
    write_control(control);
}

static avr_irq_t *switch_irq(int side)
{
    static const struct {
        char port;
        int bit;
    } at[SIDES] = {{'D', 4}, {'D', 7}, {'B', 0}, {'B', 4}};
    return avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(at[side].port), at[side].bit);
}

void light_connect(avr_t *connected)
{
    avr = connected;
    light_zero();
    avr_irq_t *trigger = avr_io_getirq(avr, AVR_IOCTL_TIMER_GETIRQ('1'), TIMER_IRQ_OUT_COMP + 0);
    avr_irq_t *strobe = avr_io_getirq(avr, AVR_IOCTL_TIMER_GETIRQ('1'), TIMER_IRQ_OUT_COMP + 1);
    avr_irq_register_notify(trigger, on_compare, (void *)TRIGGER);
    avr_irq_register_notify(strobe, on_compare, (void *)STROBE);
    avr_irq_register_notify(avr_iomem_getirq(avr, ICR1L_ADDRESS, NULL, AVR_IOMEM_IRQ_ALL), on_top,
                            NULL);
    for (long side = 0; side < SIDES; side++) {
        char timer = side < 2 ? '0' : '2';
        avr_irq_register_notify(switch_irq((int)side), on_switch, (void *)(FIRST_SIDE + side));
        avr_irq_register_notify(
            avr_io_getirq(avr, AVR_IOCTL_TIMER_GETIRQ(timer), TIMER_IRQ_OUT_PWM0 + (side & 1)),
            on_level, (void *)side);
    }
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_OUT_TRIGGER),
                            on_conversion, NULL);
}

void light_reset(void)
{
    set_pin(TRIGGER, 0);
    set_pin(STROBE, 0);
    for (int side = 0; side < SIDES; side++)
        avr_raise_irq(switch_irq(side), 0); /* simavr tells only changes of what it told last */
    memset(level, 0, sizeof level);
    look();
}

void light_set_open(int mask) { open_mask = mask; }
void light_set_short(int mask) { short_mask = mask; }
void light_set_temperature_mv(int mv) { temperature_mv = mv; }

void light_report_flashes(FILE *out, unsigned long first)
{
    if (flash_count > FLASHES_KEPT && first < flash_count - FLASHES_KEPT)
        first = flash_count - FLASHES_KEPT;
    fputs("\"flashes\":[", out);
    for (unsigned long number = first; number < flash_count; number++) {
        unsigned at = number % FLASHES_KEPT;
        fprintf(out, "%s[%lu,%.6f,%d,%d,%d,%d,%d]", number > first ? "," : "", number,
                flashes[at].at_s, flashes[at].mask, flashes[at].levels[0], flashes[at].levels[1],
                flashes[at].levels[2], flashes[at].levels[3]);
    }
    fputc(']', out);
}

static void report_range(FILE *out, const char *name, double low, double high, int any)
{
    if (any)
        fprintf(out, ",\"%s\":[%.4f,%.4f]", name, low / CYCLES_PER_US, high / CYCLES_PER_US);
    else
        fprintf(out, ",\"%s\":null", name);
}

void light_report(FILE *out)
{
    fprintf(out, "\"levels\":[%d,%d,%d,%d]", level[0], level[1], level[2], level[3]);
    fprintf(out, ",\"switches\":[%d,%d,%d,%d]", pin[2], pin[3], pin[4], pin[5]);
    fprintf(out, ",\"triggers\":%lu,\"strobes\":%lu,\"dark\":%lu", counts.triggers, counts.strobes,
            counts.dark);
    fprintf(out, ",\"lit\":[%lu,%lu,%lu,%lu]", counts.lit[0], counts.lit[1], counts.lit[2],
            counts.lit[3]);
    fprintf(out, ",\"lit_us\":[%.1f,%.1f,%.1f,%.1f]", counts.lit_cycles[0] / CYCLES_PER_US,
            counts.lit_cycles[1] / CYCLES_PER_US, counts.lit_cycles[2] / CYCLES_PER_US,
            counts.lit_cycles[3] / CYCLES_PER_US);
    fprintf(out, ",\"last_lit_cycle\":%llu", (unsigned long long)last_lit_at);
    report_range(out, "period_us", (double)counts.period_min, (double)counts.period_max,
                 counts.triggers > 1);
    report_range(out, "strobe_us", (double)counts.strobe_min, (double)counts.strobe_max,
                 counts.strobes > 1);
    report_range(out, "lead_us", (double)counts.lead_min, (double)counts.lead_max,
                 counts.lead_min <= counts.lead_max);
}
