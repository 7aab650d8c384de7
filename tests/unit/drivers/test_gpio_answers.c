// SPDX-License-Identifier: MIT
// drv_gpio on chips of our own making, in the place of libgpiod: names and labels, every refusal, edges that were lost.
#include "../../../drivers/src/gpio_backend.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>
#include <time.h>
#include <unistd.h>
#include <unity.h>

enum { CHIPS = 2, LINES = 3 };

static struct {
    int chips;
    int open_error[CHIPS]; ///< of the chip, errno
    const char* label[CHIPS];
    const char* name[LINES];
    const char* user;
    int line_error, request_error, read_error, level_error, set_error;
    int fd, level, opened, closed;
    gpio_edge_t edges[4];
    int edge_count, at; ///< at: entry of /dev that is read next
    int asked_output;
} world;
static drv_gpio_t line;
static drv_gpio_config_t config;

// ---- the machine's /dev ------------------------------------------------------------------------------------------------

DIR* opendir(const char* path) {
    world.at = 0;
    return strcmp(path, "/dev") == 0 ? (DIR*)&world : NULL;
}

struct dirent* readdir(DIR* folder) {
    static struct dirent entry;
    (void)folder;
    if (world.at > world.chips) return NULL;
    if (world.at == 0)
        strcpy(entry.d_name, "null");
    else
        snprintf(entry.d_name, sizeof entry.d_name, "gpiochip%d", world.at - 1);
    ++world.at;
    return &entry;
}

int closedir(DIR* folder) {
    (void)folder;
    return 0;
}

static int chip_of(const char* path) {
    int number = -1;
    return sscanf(path, "/dev/gpiochip%d", &number) == 1 && number < world.chips ? number : -1;
}

int access(const char* path, int mode) {
    (void)mode;
    errno = ENOENT;
    return chip_of(path) >= 0 ? 0 : -1;
}

// ---- libgpiod ----------------------------------------------------------------------------------------------------------

int gpio_backend_chip(drv_gpio_t* self, const char* path, char label[DRV_GPIO_NAME_BYTES]) {
    const int which = chip_of(path);
    if (which < 0) return -ENOENT;
    if (world.open_error[which]) return -world.open_error[which];
    self->chip = &world;
    self->line_count = LINES;
    snprintf(label, DRV_GPIO_NAME_BYTES, "%s", world.label[which]);
    ++world.opened;
    return 0;
}

int gpio_backend_line(drv_gpio_t* self, int32_t offset, gpio_line_info_t* out) {
    (void)self;
    if (world.line_error) return -world.line_error;
    snprintf(out->name, sizeof out->name, "%s", world.name[offset]);
    snprintf(out->user, sizeof out->user, "%s", world.user);
    return 0;
}

int gpio_backend_request(drv_gpio_t* self, const drv_gpio_config_t* wanted, int output) {
    (void)wanted;
    if (world.request_error) return -world.request_error;
    world.asked_output = output;
    self->line = &world;
    return 0;
}

int gpio_backend_fd(const drv_gpio_t* self) {
    (void)self;
    return world.fd;
}

int gpio_backend_read(drv_gpio_t* self, gpio_edge_t* edges, int capacity) {
    (void)self;
    if (world.read_error) return -world.read_error;
    const int count = world.edge_count < capacity ? world.edge_count : capacity;
    memcpy(edges, world.edges, sizeof *edges * (size_t)count);
    return count;
}

int gpio_backend_get(drv_gpio_t* self) {
    (void)self;
    return world.level_error ? -world.level_error : world.level;
}

int gpio_backend_set(drv_gpio_t* self, int active) {
    (void)self;
    if (world.set_error) return -world.set_error;
    world.level = active;
    return 0;
}

void gpio_backend_close(drv_gpio_t* self) {
    if (self->chip) ++world.closed;
    self->line = self->chip = NULL;
}

// ---- the tests ---------------------------------------------------------------------------------------------------------

void setUp(void) {
    memset(&world, 0, sizeof world);
    world.chips = CHIPS;
    world.label[0] = "soc";
    world.label[1] = "expander";
    for (int i = 0; i < LINES; ++i) world.name[i] = "";
    world.name[1] = "TRIGGER";
    world.user = "";
    world.fd = eventfd(0, 0);
    memset(&config, 0, sizeof config);
    config.chip = "gpiochip0";
    config.line = "TRIGGER";
    config.edge = DRV_GPIO_RISING;
}

void tearDown(void) {
    drv_gpio_close(&line);
    TEST_ASSERT_EQUAL_INT(world.opened, world.closed); // nothing stays open behind a refusal
    close(world.fd);
}

static void refused(int code, const char* text) {
    TEST_ASSERT_EQUAL_INT_MESSAGE(code, drv_gpio_open_input(&line, &config), line.error);
    TEST_ASSERT_EQUAL_STRING(text, line.error);
    TEST_ASSERT_EQUAL_INT(-1, drv_gpio_fd(&line));
}

static void test_a_chip_goes_by_name_path_or_label(void) {
    static const char* const names[] = {"gpiochip1", "/dev/gpiochip1", "expander"};
    for (int i = 0; i < 3; ++i) {
        config.chip = names[i];
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, drv_gpio_open_input(&line, &config), line.error);
        TEST_ASSERT_EQUAL_INT(1, line.offset);
        TEST_ASSERT_EQUAL_INT(world.fd, drv_gpio_fd(&line));
        drv_gpio_close(&line);
    }
    config.line = NULL;
    config.offset = 2;
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_open_output(&line, &config));
    TEST_ASSERT_EQUAL_INT(2, line.offset);
    TEST_ASSERT_EQUAL_INT(1, world.asked_output);
}

static void test_chips_are_listed(void) {
    char text[128], cut[20];
    world.open_error[1] = EACCES;
    TEST_ASSERT_EQUAL_INT(2, drv_gpio_list_chips(text, sizeof text));
    TEST_ASSERT_EQUAL_STRING("gpiochip0 (soc, 3 lines), gpiochip1 (Permission denied)", text);
    TEST_ASSERT_EQUAL_INT(2, drv_gpio_list_chips(cut, sizeof cut));
    TEST_ASSERT_EQUAL_STRING("gpiochip0 (soc, 3 l", cut);
    world.chips = 0;
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_list_chips(text, sizeof text));
    TEST_ASSERT_EQUAL_STRING("", text);
}

static void test_chips_that_are_not_there(void) {
    config.chip = "soc2";
    refused(-ENOENT, "GPIO chip soc2, line TRIGGER: there is no such chip, found: gpiochip0 (soc, 3 lines), gpiochip1 "
                     "(expander, 3 lines)");
    world.open_error[0] = EACCES;
    config.chip = "gpiochip0";
    refused(-EACCES, "GPIO chip gpiochip0, line TRIGGER: no permission to open /dev/gpiochip0");
    world.open_error[0] = EIO;
    refused(-ENOTTY, "GPIO chip gpiochip0, line TRIGGER: it is no GPIO chip that can be opened (Input/output error)");
    world.chips = 0;
    refused(-ENOTTY, "GPIO chip gpiochip0, line TRIGGER: this machine has no GPIO chip (no /dev/gpiochip*)");
}

static void test_lines_that_are_not_there(void) {
    config.line = "TRIGER";
    refused(-ENOENT, "GPIO chip gpiochip0, line TRIGER: no line has this name, names found: TRIGGER");
    world.name[2] = "LAMP";
    refused(-ENOENT, "GPIO chip gpiochip0, line TRIGER: no line has this name, names found: TRIGGER, LAMP");
    world.line_error = EIO;
    refused(-ENOENT, "GPIO chip gpiochip0, line TRIGER: no line of it has a name");
    config.line = NULL;
    config.offset = LINES;
    refused(-ENOENT, "GPIO chip gpiochip0, line 3: the chip has lines 0 to 2");
    config.offset = -1;
    refused(-ENOENT, "GPIO chip gpiochip0, line -1: the chip has lines 0 to 2");
}

static void test_requests_that_are_refused(void) {
    world.request_error = EBUSY;
    refused(-EBUSY, "GPIO chip gpiochip0, line TRIGGER: it is in use by the kernel");
    world.user = "spi0 CS0";
    refused(-EBUSY, "GPIO chip gpiochip0, line TRIGGER: it is in use by spi0 CS0");
    world.request_error = EOPNOTSUPP;
    config.debounce_us = 100;
    refused(-EOPNOTSUPP, "GPIO chip gpiochip0, line TRIGGER: libgpiod 1.6 has no debounce");
    world.request_error = ENXIO;
    refused(-ENODEV, "GPIO chip gpiochip0, line TRIGGER: the chip cannot tell its edges (No such device or address)");
    config.edge = DRV_GPIO_NO_EDGE;
    refused(-ENXIO, "GPIO chip gpiochip0, line TRIGGER: No such device or address");
}

static void test_edges_carry_host_time_and_losses(void) {
    drv_gpio_event_t events[4];
    const int64_t at = INT64_C(5000000000); // since the computer began to run
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_open_input(&line, &config));
    world.edges[0] = (gpio_edge_t){at, DRV_GPIO_RISING, 0};
    world.edges[1] = (gpio_edge_t){at + 5000, DRV_GPIO_RISING, 2};
    world.edges[2] = (gpio_edge_t){at + 9000, DRV_GPIO_FALLING, 1};
    world.edge_count = 3;
    TEST_ASSERT_EQUAL_INT(2, drv_gpio_read(&line, events, 2));
    TEST_ASSERT_EQUAL_UINT64(2, line.lost);
    TEST_ASSERT_EQUAL_INT64(at, events[0].monotonic_ns);
    TEST_ASSERT_EQUAL_INT64(5000, events[1].time_ns - events[0].time_ns);
    TEST_ASSERT_EQUAL_INT(3, drv_gpio_read(&line, events, 4));
    TEST_ASSERT_EQUAL_INT(DRV_GPIO_FALLING, events[2].edge);
    TEST_ASSERT_EQUAL_UINT32(1, events[2].lost);
    TEST_ASSERT_EQUAL_UINT64(5, line.lost);
    TEST_ASSERT_EQUAL_UINT64(5, line.events);
    TEST_ASSERT_TRUE(line.clock_error_ns > 0);
    world.read_error = EAGAIN;
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_read(&line, events, 4));
    world.read_error = EINTR;
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_read(&line, events, 4));
    world.read_error = ENODEV;
    TEST_ASSERT_EQUAL_INT(-ENODEV, drv_gpio_read(&line, events, 4));
    TEST_ASSERT_NOT_NULL(strstr(line.error, "its edges cannot be read: No such device"));
    TEST_ASSERT_EQUAL_UINT64(5, line.events);
}

static void test_levels(void) {
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_open_output(&line, &config));
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_set(&line, 17));
    TEST_ASSERT_EQUAL_INT(1, drv_gpio_get(&line));
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_set(&line, 0));
    TEST_ASSERT_EQUAL_INT(0, drv_gpio_get(&line));
    world.set_error = EPERM;
    TEST_ASSERT_EQUAL_INT(-EPERM, drv_gpio_set(&line, 1));
    TEST_ASSERT_NOT_NULL(strstr(line.error, "it cannot be set: Operation not permitted"));
    world.level_error = EIO;
    TEST_ASSERT_EQUAL_INT(-EIO, drv_gpio_get(&line));
    TEST_ASSERT_NOT_NULL(strstr(line.error, "its level cannot be read: Input/output error"));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_chip_goes_by_name_path_or_label);
    RUN_TEST(test_chips_are_listed);
    RUN_TEST(test_chips_that_are_not_there);
    RUN_TEST(test_lines_that_are_not_there);
    RUN_TEST(test_requests_that_are_refused);
    RUN_TEST(test_edges_carry_host_time_and_losses);
    RUN_TEST(test_levels);
    return UNITY_END();
}
