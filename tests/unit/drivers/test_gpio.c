// SPDX-License-Identifier: MIT
// drv_gpio where there is no chip to be had: refusals. Lines are tested on simulated chips by tests/gpio.
#include <drv/gpio.h>

#include <errno.h>
#include <string.h>
#include <unity.h>

static drv_gpio_t line;

void setUp(void) { memset(&line, 0xA5, sizeof line); }
void tearDown(void) {}

static void refused(const char* chip, const char* name, int code, const char* text) {
    drv_gpio_config_t config;
    memset(&config, 0, sizeof config);
    config.chip = chip;
    config.line = name;
    config.edge = DRV_GPIO_RISING;
    int input = drv_gpio_open_input(&line, &config);
    TEST_ASSERT_EQUAL_INT_MESSAGE(code, input, line.error);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(line.error, text), line.error);
    TEST_ASSERT_EQUAL_INT(code, drv_gpio_open_output(&line, &config));
    TEST_ASSERT_EQUAL_INT(-1, drv_gpio_fd(&line));
    drv_gpio_event_t event;
    TEST_ASSERT_EQUAL_INT(-EBADF, drv_gpio_read(&line, &event, 1));
    TEST_ASSERT_EQUAL_INT(-EBADF, drv_gpio_get(&line));
    TEST_ASSERT_EQUAL_INT(-EBADF, drv_gpio_set(&line, 1));
    drv_gpio_close(&line);
    drv_gpio_close(&line);
}

static void test_refusals(void) {
    char far_too_long[100];
    memset(far_too_long, 'x', sizeof far_too_long - 1);
    far_too_long[sizeof far_too_long - 1] = '\0';
    refused("", NULL, -EINVAL, "a chip is named by 1 to 63 characters");
    refused(NULL, NULL, -EINVAL, "a chip is named by 1 to 63 characters");
    refused(far_too_long, NULL, -EINVAL, "a chip is named by 1 to 63 characters");
    refused("gpiochip0", "", -EINVAL, "a line is named by 1 to 63 characters");
    refused("gpiochip0", far_too_long, -EINVAL, "a line is named by 1 to 63 characters");
    refused("/dev/null", "A", -ENOTTY, "GPIO chip /dev/null, line A: it is no GPIO chip");
}

static void test_chip_that_is_not_there(void) {
    char chips[256];
    int any = drv_gpio_list_chips(chips, sizeof chips) > 0;
    TEST_ASSERT_EQUAL_INT(any, chips[0] != '\0');
    refused("okid-no-such-chip", NULL, any ? -ENOENT : -ENOTTY,
            any ? "found: gpiochip" : "this machine has no GPIO chip");
    refused("/dev/okid-no-such-chip", NULL, any ? -ENOENT : -ENOTTY, "line 0: ");
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_refusals);
    RUN_TEST(test_chip_that_is_not_there);
    return UNITY_END();
}
