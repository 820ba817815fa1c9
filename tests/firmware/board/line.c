/* The emulated serial line: see line.h.
 *
 * Copyright (C) 2026 the cornertouchd authors
 *
 * This test program is linked with libsimavr and is, like it, free software under the GNU General
 * Public License, version 3 or later: https://www.gnu.org/licenses/.  It comes WITHOUT ANY WARRANTY.
 * It is no part of cornertouchd, which is under the MIT licence and only talks to it.
 */
#define _GNU_SOURCE
#include "line.h"

#include <avr_uart.h>
#include <fcntl.h>
#include <pty.h>
#include <termios.h>
#include <unistd.h>

#define BYTE_CYCLES 320 /* ten bits at 500 kbaud and 16 MHz */
#define QUEUE 65536u

static avr_t *avr;
static const char *link_name;
static int host_end = -1, held_end = -1;
static uint8_t queue[QUEUE];
static unsigned head, tail;
static int may_send = 1, opening_resets, deaf, noise_in, noise_out;
static unsigned random_state = 1;
static unsigned long bytes_in, bytes_out;
static avr_cycle_count_t last_byte_at;

/* The numbers of ISO C's example; any would do, but they are the same in every run. */
static unsigned next_random(void)
{
    random_state = random_state * 1103515245u + 12345u;
    return random_state >> 16 & 0x7FFF;
}

static uint8_t with_noise(uint8_t byte, int one_in)
{
    if (one_in && next_random() % (unsigned)one_in == 0)
        return byte ^ (uint8_t)(1u << (next_random() & 7));
    return byte;
}

int line_plug(const char *link)
{
    struct termios raw;
    char name[128], temporary[256];
    if (host_end >= 0)
        return 0;
    if (openpty(&host_end, &held_end, name, NULL, NULL)) /* the held end: no hang-up between hosts */
        return -1;
    tcgetattr(held_end, &raw);
    cfmakeraw(&raw);
    tcsetattr(held_end, TCSANOW, &raw);
    fcntl(host_end, F_SETFL, O_NONBLOCK);
    link_name = link;
    snprintf(temporary, sizeof temporary, "%s.new", link);
    unlink(temporary);
    return symlink(name, temporary) || rename(temporary, link) ? -1 : 0;
}

void line_unplug(void)
{
    if (host_end < 0)
        return;
    unlink(link_name);
    close(host_end);
    close(held_end);
    host_end = held_end = -1;
    head = tail;
}

static void to_host(uint8_t byte)
{
    if (host_end >= 0 && write(host_end, &byte, 1) == 1)
        bytes_out++;
}

static void on_byte(struct avr_irq_t *irq, uint32_t value, void *unused)
{
    (void)irq;
    (void)unused;
    to_host(with_noise((uint8_t)value, noise_out));
}

static void on_xon(struct avr_irq_t *irq, uint32_t value, void *may)
{
    (void)irq;
    (void)value;
    may_send = (int)(long)may;
}

static avr_cycle_count_t feed(avr_t *fed, avr_cycle_count_t when, void *unused)
{
    (void)unused;
    if (head != tail && may_send && !deaf) {
        uint8_t byte = with_noise(queue[tail], noise_in);
        tail = (tail + 1) % QUEUE;
        bytes_in++;
        last_byte_at = fed->cycle;
        avr_raise_irq(avr_io_getirq(fed, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), byte);
    }
    return when + BYTE_CYCLES;
}

void line_connect(avr_t *connected)
{
    avr = connected;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_t *out = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT);
    avr_irq_t *xon = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON);
    avr_irq_t *xoff = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF);
    avr_irq_register_notify(out, on_byte, NULL);
    avr_irq_register_notify(xon, on_xon, (void *)1L);
    avr_irq_register_notify(xoff, on_xon, (void *)0L);
    line_reset();
}

void line_reset(void)
{
    may_send = 1;
    avr_cycle_timer_register(avr, BYTE_CYCLES, feed, NULL);
}

static int was_opened(void)
{
    static speed_t known;
    struct termios set;
    if (!opening_resets || held_end < 0 || tcgetattr(held_end, &set) || cfgetospeed(&set) == known)
        return 0;
    known = cfgetospeed(&set);
    return 1;
}

int line_poll(void)
{
    unsigned room = QUEUE - 1 - (head - tail + QUEUE) % QUEUE;
    uint8_t bytes[512];
    ssize_t count = host_end < 0 ? 0 : read(host_end, bytes, room < sizeof bytes ? room : sizeof bytes);
    for (ssize_t i = 0; i < count; i++) {
        queue[head] = bytes[i];
        head = (head + 1) % QUEUE;
    }
    return was_opened();
}

void line_set_opening_resets(int resets) { opening_resets = resets; }

void line_set_noise(int in, int out)
{
    noise_in = in;
    noise_out = out;
}

void line_set_deaf(int is_deaf) { deaf = is_deaf; }

void line_babble(int count)
{
    while (count-- > 0)
        to_host((uint8_t)next_random());
}

void line_report(FILE *out)
{
    fprintf(out, "\"bytes_in\":%lu,\"bytes_out\":%lu,\"last_byte_cycle\":%llu", bytes_in, bytes_out,
            (unsigned long long)last_byte_at);
}
