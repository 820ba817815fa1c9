/* The LED frame's board, emulated: the real binary for the ATmega328P on libsimavr.
 *
 *   board FIRMWARE.elf LINK
 *   board BOOTLOADER.hex LINK [CONTROLLER]
 *
 * With a bootloader it is an Arduino without firmware: resets begin in the bootloader, and opening the
 * port is a reset.  CONTROLLER is an atmega328p unless it is named.  LINK becomes a symbolic link to the pseudo-terminal that is the board's serial port.  Commands
 * come on stdin, one a line; each is answered by one line of JSON.  It ends with stdin.
 *
 *   get                       what shines and shone, see light.c
 *   flashes N                 the flashes from number N on: number, time, mask, levels
 *   zero                      count anew
 *   wait MS                   answered when so much time of the controller has passed
 *   fault 0|1                 the over-current line
 *   open MASK, short MASK     sides without LEDs, sides that are shorted
 *   temperature MV            voltage of the sensor
 *   noise_in N, noise_out N   one bit in N bytes flipped; 0 ends it
 *   deaf 0|1                  bytes from the host wait
 *   babble N                  N random bytes to the host
 *   unplug, plug              the USB cable
 *   reset, brownout           the reset line, a drop of the supply
 *   program FILE              write what stands in the program memory to a file
 *
 * Copyright (C) 2026 the cornertouchd authors
 *
 * This test program is linked with libsimavr and is, like it, free software under the GNU General
 * Public License, version 3 or later: https://www.gnu.org/licenses/.  It comes WITHOUT ANY WARRANTY.
 * It is no part of cornertouchd, which is under the MIT licence and only talks to it.
 */
#define _GNU_SOURCE
#include <avr_ioport.h>
#include <fcntl.h>
#include <poll.h>
#include <sim_avr.h>
#include <sim_elf.h>
#include <sim_regbit.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "clock.h"
#include "light.h"
#include "line.h"

#define FREQUENCY 16000000u
#define FARTHEST_BEHIND_S 0.25
#define SLICE_CYCLES 4000u /* a quarter of a millisecond */
#define CYCLES_PER_MS 16000u
#define PIND_ADDRESS 0x29

static avr_t *avr;
static FILE *answers;
static const char *link_name;
static int noise_in, noise_out, overcurrent, starts = 1, lags;
static avr_cycle_count_t answer_wait_at;
static void (*core_reset)(avr_t *);

/* The level must be told, too: otherwise the pull-up wins when the port is written next. */
static void set_overcurrent(int active)
{
    overcurrent = active;
    avr_ioport_external_t level = {.name = 'D', .mask = 1u << 2, .value = active ? 0 : 1u << 2};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &level);
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 2), active ? 0 : 1);
}

static void after_reset(avr_t *reset)
{
    if (core_reset)
        core_reset(reset);
    starts++;
    line_reset();
    light_reset();
    /* A reset makes all pins read low, and no unchanged level is told again. */
    set_overcurrent(overcurrent);
    if (!overcurrent)
        reset->data[PIND_ADDRESS] |= 1u << 2;
}

/* Real time is kept here, by slices. */
static void no_sleep(avr_t *sleeping, avr_cycle_count_t cycles)
{
    (void)sleeping;
    (void)cycles;
}

static void log_errors(avr_t *logged, const int level, const char *format, va_list values)
{
    (void)logged;
    if (level <= LOG_ERROR)
        vfprintf(stderr, format, values);
}

static int load_firmware(const char *path)
{
    static elf_firmware_t firmware;
    if (elf_read_firmware(path, &firmware))
        return -1;
    firmware.frequency = FREQUENCY;
    avr_load_firmware(avr, &firmware);
    return 0;
}

/* Intel HEX, data records only: simavr's own reader adds what other records say.  The first address
 * is where it starts. */
static int load_bootloader(const char *path)
{
    char line[600];
    unsigned count, address, type, byte, is_first = 1;
    FILE *file = fopen(path, "r");
    if (!file)
        return -1;
    avr->frequency = FREQUENCY;
    avr->codeend = avr->flashend;
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, ":%2x%4x%2x", &count, &address, &type) != 3 || type != 0)
            continue;
        if (is_first)
            avr->pc = avr->reset_pc = address;
        is_first = 0;
        for (unsigned at = 0; at < count && address + at <= avr->flashend; at++)
            if (sscanf(line + 9 + 2 * at, "%2x", &byte) == 1)
                avr->flash[address + at] = (uint8_t)byte;
    }
    fclose(file);
    return is_first ? -1 : 0;
}

static int load(const char *path, const char *controller)
{
    const char *suffix = strrchr(path, '.');
    int is_bootloader = suffix && !strcmp(suffix, ".hex");
    avr_global_logger_set(log_errors);
    avr = avr_make_mcu_by_name(controller);
    if (!avr)
        return -1;
    avr_init(avr);
    avr->log = LOG_ERROR;
    if (is_bootloader ? load_bootloader(path) : load_firmware(path))
        return -1;
    line_set_opening_resets(is_bootloader);
    avr->sleep = no_sleep;
    avr->vcc = avr->avcc = avr->aref = 5000;
    line_connect(avr);
    light_connect(avr);
    set_overcurrent(0);
    core_reset = avr->reset;
    avr->reset = after_reset;
    return 0;
}

static void answer_all(void)
{
    fprintf(answers, "{\"cycle\":%llu,\"starts\":%d,\"lags\":%d,", (unsigned long long)avr->cycle, starts, lags);
    line_report(answers);
    fputc(',', answers);
    light_report(answers);
    fputs("}\n", answers);
    fflush(answers);
}

static void answer_flashes(unsigned long first)
{
    fputc('{', answers);
    light_report_flashes(answers, first);
    fputs("}\n", answers);
    fflush(answers);
}

static void answer(const char *name, const char *value)
{
    fprintf(answers, "{\"%s\":\"%s\"}\n", name, value);
    fflush(answers);
}

static void reset_line(void)
{
    avr_reset(avr);
    avr_regbit_setto(avr, avr->reset_flags.porf, 0);
    avr_regbit_set(avr, avr->reset_flags.extrf);
}

static void write_program(const char *path)
{
    FILE *file = fopen(path, "wb");
    if (file) {
        fwrite(avr->flash, 1, avr->flashend + 1, file);
        fclose(file);
    }
    answer(file ? "done" : "failed", "program");
}

static int set(const char *what, int value)
{
    if (!strcmp(what, "fault"))
        set_overcurrent(value);
    else if (!strcmp(what, "open"))
        light_set_open(value);
    else if (!strcmp(what, "short"))
        light_set_short(value);
    else if (!strcmp(what, "temperature"))
        light_set_temperature_mv(value);
    else if (!strcmp(what, "noise_in"))
        line_set_noise(noise_in = value, noise_out);
    else if (!strcmp(what, "noise_out"))
        line_set_noise(noise_in, noise_out = value);
    else if (!strcmp(what, "deaf"))
        line_set_deaf(value);
    else if (!strcmp(what, "babble"))
        line_babble(value);
    else
        return 0;
    return 1;
}

static int act(const char *what)
{
    if (!strcmp(what, "zero")) {
        light_zero();
    } else if (!strcmp(what, "unplug")) {
        line_unplug();
    } else if (!strcmp(what, "plug")) {
        if (line_plug(link_name))
            return 0;
    } else if (!strcmp(what, "reset")) {
        reset_line();
    } else if (!strcmp(what, "brownout")) {
        avr_reset(avr);
        avr_regbit_setto(avr, avr->reset_flags.porf, 0);
        avr_regbit_set(avr, avr->reset_flags.borf);
    } else {
        return 0;
    }
    return 1;
}

static void command(const char *line)
{
    char what[32] = "", path[256] = "";
    int value = 0;
    sscanf(line, "%31s %255s", what, path);
    sscanf(line, "%*s %d", &value);
    if (!strcmp(what, "get"))
        answer_all();
    else if (!strcmp(what, "flashes"))
        answer_flashes((unsigned long)value);
    else if (!strcmp(what, "wait"))
        answer_wait_at = avr->cycle + (avr_cycle_count_t)value * CYCLES_PER_MS;
    else if (!strcmp(what, "program"))
        write_program(path);
    else if (act(what) || set(what, value))
        answer("done", what);
    else
        answer("unknown", what);
}

/* Read commands for at most `wait_ns`; returns 0 at the end of stdin. */
static int take_commands(long wait_ns)
{
    static char text[512];
    static size_t length;
    struct pollfd input = {.fd = 0, .events = POLLIN};
    struct timespec wait = {.tv_nsec = wait_ns};
    if (ppoll(&input, 1, &wait, NULL) <= 0)
        return 1;
    ssize_t count = read(0, text + length, sizeof text - 1 - length);
    if (count <= 0)
        return 0;
    length += (size_t)count;
    text[length] = 0;
    for (char *end = strchr(text, '\n'); end; end = strchr(text, '\n')) {
        *end = 0;
        command(text);
        length -= (size_t)(end + 1 - text);
        memmove(text, end + 1, length + 1);
    }
    return 1;
}

static int run_slice(void)
{
    avr_cycle_count_t until = avr->cycle + SLICE_CYCLES;
    while (avr->cycle < until) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed)
            return 0;
    }
    if (line_poll())
        reset_line();
    if (answer_wait_at && avr->cycle >= answer_wait_at) {
        answer_wait_at = 0;
        answer("done", "wait");
    }
    return 1;
}

/* Time of the controller is real time, or slower where the machine is busy. */
static int run(void)
{
    clock_set(avr);
    while (run_slice()) {
        double ahead_s = clock_of(avr) - now_s();
        if (ahead_s < -FARTHEST_BEHIND_S) {
            clock_set(avr);
            lags++;
        }
        if (!take_commands(ahead_s > 0.0001 ? (long)(ahead_s * 1e9) : 0))
            return 0;
    }
    answer("dead", "the controller has crashed");
    return 1;
}

int main(int argc, char **argv)
{
    answers = fdopen(dup(1), "w");
    dup2(2, 1); /* libsimavr writes to stdout */
    if (argc != 3 && argc != 4) {
        fprintf(stderr, "usage: board FIRMWARE.elf|BOOTLOADER.hex LINK [CONTROLLER]\n");
        return 2;
    }
    link_name = argv[2];
    if (load(argv[1], argc > 3 ? argv[3] : "atmega328p") || line_plug(link_name)) {
        perror(argv[1]);
        return 1;
    }
    answer("ready", link_name);
    int status = run();
    line_unplug();
    return status;
}
