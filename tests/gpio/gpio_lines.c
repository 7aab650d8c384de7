// SPDX-License-Identifier: MIT
// drv_gpio on a simulated chip; built once a libgpiod API and run in the test kernel. Its interrupts come at the tick of
// 10 ms: edges stand 20 ms apart, and stamps may be a tick late.
#include "gpio_sim.h"

#include <drv/gpio.h>
#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <unity.h>

static const int64_t ms = 1000000;
static gpio_sim_t sim;
static drv_gpio_t line;

void setUp(void) {
    sim_remove();
    TEST_ASSERT_EQUAL_INT(0, sim_make(&sim));
    memset(&line, 0, sizeof line);
}
void tearDown(void) {
    drv_gpio_close(&line);
    sim_remove();
}

static drv_gpio_config_t at(int32_t offset) {
    drv_gpio_config_t config;
    memset(&config, 0, sizeof config);
    config.chip = sim.chip;
    config.offset = offset;
    return config;
}

static int64_t now_ns(clockid_t clock) {
    struct timespec now;
    clock_gettime(clock, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/// Both clocks at one moment: CLOCK_REALTIME, and the CLOCK_MONOTONIC before and after it (the host may pause us between).
typedef struct moment_t {
    int64_t before, real, after;
} moment_t;

static moment_t moment_now(void) {
    moment_t best = {0, 0, INT64_MAX};
    for (int i = 0; i < 5; ++i) {
        moment_t one = {.before = now_ns(CLOCK_MONOTONIC)};
        one.real = now_ns(CLOCK_REALTIME);
        one.after = now_ns(CLOCK_MONOTONIC);
        if (one.after - one.before < best.after - best.before) best = one;
    }
    return best;
}

/// Wait until `count` edges came, a second at most. @return how many came
static int collect(drv_gpio_event_t* events, int count) {
    int have = 0;
    for (int tries = 0; have < count && tries < 100; ++tries) {
        struct pollfd wait = {drv_gpio_fd(&line), POLLIN, 0};
        (void)poll(&wait, 1, 10);
        int got = drv_gpio_read(&line, events + have, count - have);
        TEST_ASSERT_TRUE_MESSAGE(got >= 0, line.error);
        have += got;
    }
    return have;
}

static void test_rising_edges(void) {
    drv_gpio_config_t config = at(2);
    config.edge = DRV_GPIO_RISING;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_gpio_open_input(&line, &config), line.error);
    TEST_ASSERT_TRUE(drv_gpio_fd(&line) >= 0);
    drv_gpio_event_t events[12];
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_read(&line, events, 12));
    moment_t pulled[10];
    int64_t seen[10];
    for (int i = 0; i < 10; ++i) {
        pulled[i] = moment_now();
        TEST_ASSERT_EQUAL_INT(0, sim_pull(&sim, 2, 1));
        sim_pause(20);
        seen[i] = now_ns(CLOCK_MONOTONIC);
        TEST_ASSERT_EQUAL_INT(0, sim_pull(&sim, 2, 0));
        sim_pause(20);
    }
    TEST_ASSERT_EQUAL_INT(10, collect(events, 10));
    for (int i = 0; i < 10; ++i) {
        TEST_ASSERT_EQUAL_INT(DRV_GPIO_RISING, events[i].edge);
        TEST_ASSERT_EQUAL_UINT32(0, events[i].lost);
        TEST_ASSERT_TRUE(events[i].monotonic_ns >= pulled[i].before && events[i].monotonic_ns <= seen[i]);
        const int64_t middle = pulled[i].before + (pulled[i].after - pulled[i].before) / 2;
        const int64_t carried = events[i].time_ns - events[i].monotonic_ns, apart = carried - (pulled[i].real - middle);
        TEST_ASSERT_TRUE(llabs(apart) <= line.clock_error_ns + (pulled[i].after - pulled[i].before) + 2 * ms);
    }
    TEST_ASSERT_TRUE(line.clock_error_ns > 0);
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_read(&line, events, 12));
    TEST_ASSERT_EQUAL_UINT64(10, line.events);
    TEST_ASSERT_EQUAL_UINT64(0, line.lost);
}

static void test_both_edges_active_low_by_names(void) {
    drv_gpio_config_t config = at(-1);
    config.chip = "okid-sim"; // the label
    config.line = "BUTTON";
    config.edge = DRV_GPIO_BOTH;
    config.active_low = 1;
    TEST_ASSERT_EQUAL_INT(0, sim_pull(&sim, 2, 1));
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_gpio_open_input(&line, &config), line.error);
    TEST_ASSERT_EQUAL_INT(2, line.offset);
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_get(&line));
    drv_gpio_event_t events[4];
    for (int i = 0; i < 4; ++i) {
        TEST_ASSERT_EQUAL_INT(0, sim_pull(&sim, 2, i & 1));
        sim_pause(20);
        TEST_ASSERT_EQUAL_INT(!(i & 1), drv_gpio_get(&line));
    }
    TEST_ASSERT_EQUAL_INT(4, collect(events, 4));
    for (int i = 0; i < 4; ++i) TEST_ASSERT_EQUAL_INT(i & 1 ? DRV_GPIO_FALLING : DRV_GPIO_RISING, events[i].edge);
    for (int i = 1; i < 4; ++i) TEST_ASSERT_TRUE(events[i].time_ns > events[i - 1].time_ns + 9 * ms);
    TEST_ASSERT_EQUAL_UINT64(0, line.lost);
}

static void test_bias_pulls_up(void) {
    drv_gpio_config_t config = at(1);
    config.bias = DRV_GPIO_BIAS_PULL_UP;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_gpio_open_input(&line, &config), line.error);
    TEST_ASSERT_EQUAL_INT(1, drv_gpio_get(&line));
    TEST_ASSERT_EQUAL_INT(-1, drv_gpio_fd(&line)); // no edges asked for
    drv_gpio_event_t event;
    TEST_ASSERT_EQUAL_INT(-EBADF, drv_gpio_read(&line, &event, 1));
}

/// More edges than the kernel keeps while nobody reads: 16 (1.6, newest dropped) or 1024 (2.x, oldest dropped).
static void test_lost_edges_are_told(void) {
    drv_gpio_config_t config = at(3);
    config.edge = DRV_GPIO_BOTH;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_gpio_open_input(&line, &config), line.error);
    const int made = GPIO_API == 1 ? 17 : 1041;
    for (int i = 0; i < made; ++i) {
        TEST_ASSERT_EQUAL_INT(0, sim_pull(&sim, 3, !(i & 1)));
        sim_pause(20);
    }
    drv_gpio_event_t events[1100];
    const int kept = GPIO_API == 1 ? 16 : 1024;
    TEST_ASSERT_EQUAL_INT(kept, collect(events, kept));
    TEST_ASSERT_EQUAL_INT(0, sim_pull(&sim, 3, 0));
    TEST_ASSERT_EQUAL_INT(1, collect(events, 1));
    TEST_ASSERT_EQUAL_UINT64((uint64_t)(made - kept), line.lost);
}

static void test_output(void) {
    drv_gpio_config_t config = at(-1);
    config.line = "LAMP";
    config.initial = 1;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_gpio_open_output(&line, &config), line.error);
    TEST_ASSERT_EQUAL_INT(1, sim_value(&sim, 5));
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_set(&line, 0));
    TEST_ASSERT_EQUAL_INT(0, sim_value(&sim, 5));
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_get(&line));
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_set(&line, 1));
    TEST_ASSERT_EQUAL_INT(1, sim_value(&sim, 5));
    drv_gpio_close(&line);
    TEST_ASSERT_EQUAL_INT(-EBADF, drv_gpio_set(&line, 1));
    config.active_low = 1;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_gpio_open_output(&line, &config), line.error);
    TEST_ASSERT_EQUAL_INT(0, sim_value(&sim, 5));
    TEST_ASSERT_EQUAL_INT(1, drv_gpio_get(&line));
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_set(&line, 0));
    TEST_ASSERT_EQUAL_INT(1, sim_value(&sim, 5));
}

static void test_debounce(void) {
    drv_gpio_config_t config = at(4);
    config.edge = DRV_GPIO_RISING;
    config.debounce_us = 30000;
    int code = drv_gpio_open_input(&line, &config);
    if (GPIO_API == 1) {
        TEST_ASSERT_EQUAL_INT(-EOPNOTSUPP, code);
        TEST_ASSERT_NOT_NULL(strstr(line.error, "libgpiod 1.6 has no debounce"));
        return;
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, code, line.error);
    drv_gpio_event_t events[4];
    TEST_ASSERT_EQUAL_INT(0, sim_pull(&sim, 4, 1));
    sim_pause(10); // a bounce
    TEST_ASSERT_EQUAL_INT(0, sim_pull(&sim, 4, 0));
    sim_pause(100);
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_read(&line, events, 4));
    TEST_ASSERT_EQUAL_INT(0, sim_pull(&sim, 4, 1));
    TEST_ASSERT_EQUAL_INT(1, collect(events, 1));
}

/// Opens and expects a code and a piece of the sentence.
static void refused(const drv_gpio_config_t* config, int code, const char* text) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(code, drv_gpio_open_input(&line, config), line.error);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(line.error, text), line.error);
    TEST_ASSERT_NULL(line.line);
    TEST_ASSERT_NULL(line.chip);
}

static void test_refusals_say_what_was_found(void) {
    drv_gpio_config_t config = at(8);
    refused(&config, -ENOENT, "the chip has lines 0 to 7");
    config = at(0);
    config.chip = "gpiochip77";
    refused(&config, -ENOENT, "GPIO chip gpiochip77, line 0: there is no such chip, found: gpiochip");
    TEST_ASSERT_NOT_NULL(strstr(line.error, "(okid-sim, 8 lines)"));
    config = at(0);
    config.line = "KNOB";
    refused(&config, -ENOENT, "line KNOB: no line has this name, names found: BUTTON, LAMP");
    config = at(0);
    config.chip = "/dev/null";
    refused(&config, -ENOTTY, "it is no GPIO chip");
    drv_gpio_t first;
    config = at(6);
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_open_output(&first, &config));
    refused(&config, -EBUSY, "line 6: it is in use by okid");
    drv_gpio_close(&first);
    char path[128];
    snprintf(path, sizeof path, "/dev/%s", sim.chip);
    TEST_ASSERT_EQUAL_INT(0, chmod(path, 0600));
    TEST_ASSERT_EQUAL_INT(0, seteuid(65534));
    int code = drv_gpio_open_input(&line, &config);
    TEST_ASSERT_EQUAL_INT(0, seteuid(0));
    TEST_ASSERT_EQUAL_INT(-EACCES, code);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(line.error, "no permission to open /dev/gpiochip"), line.error);
}

/// The chip goes away (a USB one is pulled out): an error, no hang.
static void test_chip_goes_away(void) {
    drv_gpio_config_t config = at(2);
    config.edge = DRV_GPIO_RISING;
    TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_gpio_open_input(&line, &config), line.error);
    sim_remove();
    drv_gpio_event_t events[2];
    struct pollfd wait = {drv_gpio_fd(&line), POLLIN, 0};
    (void)poll(&wait, 1, 100);
    int got = drv_gpio_read(&line, events, 2);
    TEST_ASSERT_TRUE_MESSAGE(got <= 0, line.error);
    TEST_ASSERT_TRUE(drv_gpio_get(&line) < 0);
    TEST_ASSERT_NOT_NULL(strstr(line.error, "its level cannot be read"));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_rising_edges);
    RUN_TEST(test_both_edges_active_low_by_names);
    RUN_TEST(test_bias_pulls_up);
    if (GPIO_API == 1 || getenv("OKID_SLOW")) RUN_TEST(test_lost_edges_are_told); // 2.x: 21 s
    RUN_TEST(test_output);
    RUN_TEST(test_debounce);
    RUN_TEST(test_refusals_say_what_was_found);
    RUN_TEST(test_chip_goes_away);
    return UNITY_END();
}
