// SPDX-License-Identifier: MIT
// Messages of rtnetlink: whole, cut at every byte, damaged.
#include "../../fault/fake_can.h"

#include <drv/link.h>

#include <ftw.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>
#include <unity.h>

static _Alignas(8) char message[FAKE_MESSAGE_BYTES];
static drv_link_t link_state;

void setUp(void) {
    fake_reset();
    memset(&link_state, 0xEE, sizeof link_state);
}
void tearDown(void) {}

static void test_every_field(void) {
    fake.state = CAN_STATE_BUS_OFF;
    fake.restart_ms = 100;
    fake.rx_dropped = 7;
    fake.rx_over_errors = 8;
    TEST_ASSERT_EQUAL_INT(0, drv_link_parse(message, fake_link_message(message, RTM_NEWLINK), &link_state));
    TEST_ASSERT_EQUAL_STRING("can0", link_state.name);
    TEST_ASSERT_EQUAL_STRING("can", link_state.kind);
    TEST_ASSERT_EQUAL_INT(5, link_state.index);
    TEST_ASSERT_TRUE(link_state.is_can && link_state.up && link_state.running && !link_state.gone);
    TEST_ASSERT_TRUE(link_state.has_can_data && link_state.listen_only && link_state.has_error_counters);
    TEST_ASSERT_EQUAL_INT(72, link_state.mtu);
    TEST_ASSERT_EQUAL_UINT32(10, link_state.tx_queue);
    TEST_ASSERT_EQUAL_INT(DRV_BUS_OFF, link_state.state);
    TEST_ASSERT_EQUAL_STRING("bus-off", drv_bus_state_name(link_state.state));
    TEST_ASSERT_EQUAL_UINT32(12, link_state.tx_errors);
    TEST_ASSERT_EQUAL_UINT32(34, link_state.rx_errors);
    TEST_ASSERT_EQUAL_UINT32(500000, link_state.bitrate);
    TEST_ASSERT_EQUAL_UINT32(2000000, link_state.dbitrate);
    TEST_ASSERT_EQUAL_UINT32(100, link_state.restart_ms);
    TEST_ASSERT_EQUAL_UINT64(7, link_state.rx_dropped);
    TEST_ASSERT_EQUAL_UINT64(8, link_state.rx_over_errors);
    const struct can_device_stats order = {1, 2, 3, 4, 5, 6};
    TEST_ASSERT_EQUAL_UINT32(order.bus_off, link_state.bus_off_count);
    TEST_ASSERT_EQUAL_UINT32(order.restarts, link_state.restart_count);
}

static void test_states(void) {
    static const drv_bus_state_t states[] = {DRV_BUS_ACTIVE,  DRV_BUS_WARNING,  DRV_BUS_PASSIVE, DRV_BUS_OFF,
                                             DRV_BUS_STOPPED, DRV_BUS_SLEEPING, DRV_BUS_UNKNOWN};
    for (uint32_t i = 0; i < 7; ++i) {
        fake.state = i;
        TEST_ASSERT_EQUAL_INT(0, drv_link_parse(message, fake_link_message(message, RTM_NEWLINK), &link_state));
        TEST_ASSERT_EQUAL_INT(states[i], link_state.state);
    }
    TEST_ASSERT_EQUAL_STRING("error-active", drv_bus_state_name(DRV_BUS_ACTIVE));
    TEST_ASSERT_EQUAL_STRING("unknown", drv_bus_state_name((drv_bus_state_t)99));
}

static void test_other_kinds_have_no_can_data(void) {
    fake.kind = "vcan";
    TEST_ASSERT_EQUAL_INT(0, drv_link_parse(message, fake_link_message(message, RTM_NEWLINK), &link_state));
    TEST_ASSERT_EQUAL_STRING("vcan", link_state.kind);
    TEST_ASSERT_FALSE(link_state.has_can_data);
    TEST_ASSERT_EQUAL_UINT32(0, link_state.bitrate);
    TEST_ASSERT_EQUAL_INT(0, drv_link_parse(message, fake_link_message(message, RTM_DELLINK), &link_state));
    TEST_ASSERT_TRUE(link_state.gone && !link_state.up);
}

/// A copy of just the bytes given, so that a sanitizer sees every step beyond them.
static int parse_copy(const char* from, size_t bytes) {
    char* copy = malloc(bytes + 1);
    memcpy(copy, from, bytes);
    const int verdict = drv_link_parse(copy, bytes, &link_state);
    free(copy);
    return verdict;
}

static void test_cut_and_damaged_messages(void) {
    const size_t whole = fake_link_message(message, RTM_NEWLINK);
    for (size_t bytes = 0; bytes < whole; ++bytes) TEST_ASSERT_EQUAL_INT(-1, parse_copy(message, bytes));
    for (uint32_t bytes = NLMSG_SPACE(sizeof(struct ifinfomsg)); bytes < whole; ++bytes) {
        memcpy(message, &bytes, sizeof bytes); // the header admits that it is shorter
        TEST_ASSERT_EQUAL_INT(0, parse_copy(message, bytes));
    }
    srand(3);
    int understood = 0;
    for (int i = 0; i < 100000; ++i) {
        fake_link_message(message, RTM_NEWLINK);
        for (int k = rand() % 4; k >= 0; --k) message[16 + rand() % (int)(whole - 16)] = (char)rand();
        understood += parse_copy(message, whole) == 0;
        TEST_ASSERT_TRUE(memchr(link_state.name, 0, sizeof link_state.name) != NULL);
        TEST_ASSERT_TRUE(memchr(link_state.kind, 0, sizeof link_state.kind) != NULL);
    }
    TEST_ASSERT_EQUAL_INT(100000, understood);
}

static void test_questions_and_answers(void) {
    TEST_ASSERT_EQUAL_INT(0, drv_link_read("can0", &link_state));
    TEST_ASSERT_EQUAL_INT(5, link_state.index);
    fake.index = 0;
    TEST_ASSERT_EQUAL_INT(-ENODEV, drv_link_read("can0", &link_state));
    TEST_ASSERT_EQUAL_INT(-ENODEV, drv_link_read("a_name_of_16_chr", &link_state));
    fake.index = 5;
    fake.late_answers = 3; // the question is waited for, but not for ever
    TEST_ASSERT_EQUAL_INT(0, drv_link_read("can0", &link_state));
    fake.late_answers = 4;
    TEST_ASSERT_EQUAL_INT(-ETIMEDOUT, drv_link_read("can0", &link_state));
    fake.listen_error = EPERM;
    TEST_ASSERT_EQUAL_INT(-EPERM, drv_link_watch());
    fake.asked = -1;
    TEST_ASSERT_EQUAL_INT(-EPERM, drv_link_read("can0", &link_state));
    fake.netlink_error = EMFILE;
    TEST_ASSERT_EQUAL_INT(-EMFILE, drv_link_read("can0", &link_state));
    TEST_ASSERT_EQUAL_INT(-EMFILE, drv_link_watch());
}

static void test_news_of_one_interface(void) {
    const int fd = drv_link_watch();
    TEST_ASSERT_TRUE(fd >= 0);
    TEST_ASSERT_EQUAL_INT(0, drv_link_changes(fd, "can0", &link_state));
    fake_tell(RTM_NEWLINK);
    fake.up = 0;
    fake_tell(RTM_NEWLINK);
    fake.name = "eth0";
    fake_tell(RTM_NEWLINK);
    TEST_ASSERT_EQUAL_INT(1, drv_link_changes(fd, "can0", &link_state));
    TEST_ASSERT_FALSE(link_state.up); // the newest
    TEST_ASSERT_EQUAL_STRING("can0", link_state.name);
    TEST_ASSERT_EQUAL_INT(0, drv_link_changes(fd, "can0", &link_state));
    fake_tell_error(ENOBUFS);
    TEST_ASSERT_EQUAL_INT(1, drv_link_changes(fd, "can0", &link_state));
    TEST_ASSERT_EQUAL_INT(0, link_state.index);
    close(fd);
}

// A sysfs of our own: interfaces with type and index, and what their device links lead to.
static char sysfs[] = "/tmp/okid-link-XXXXXX";

static const char* path_of(const char* folder, const char* file) {
    static char path[256];
    snprintf(path, sizeof path, "%s/%s/%s", sysfs, folder, file);
    for (char* slash = path + strlen(sysfs) + 1; (slash = strchr(slash, '/')); *slash++ = '/') {
        *slash = '\0';
        (void)mkdir(path, 0700);
    }
    return path;
}

static void write_line(const char* folder, const char* file, const char* text) {
    FILE* out = fopen(path_of(folder, file), "we");
    TEST_ASSERT_NOT_NULL(out);
    fprintf(out, "%s\n", text);
    fclose(out);
}

static void add_adapter(const char* port, const char* serial) {
    char folder[64], driven[160];
    snprintf(folder, sizeof folder, "devices/pci0/usb1/%s", port);
    snprintf(driven, sizeof driven, "%s/%s:1.0", folder, port);
    write_line(folder, "idVendor", "1d50");
    write_line(driven, "bInterfaceNumber", "00");
    if (serial) write_line(folder, "serial", serial);
}

static void add_interface(const char* name, const char* type, const char* index, const char* port) {
    char folder[64], device[64];
    snprintf(folder, sizeof folder, "class/net/%s", name);
    snprintf(device, sizeof device, "../../../devices/pci0/usb1/%s/%s:1.0", port, port);
    write_line(folder, "type", type);
    write_line(folder, "ifindex", index);
    if (port[0]) TEST_ASSERT_EQUAL_INT(0, symlink(device, path_of(folder, "device")));
}

static int remove_one(const char* path, const struct stat* what, int kind, struct FTW* where) {
    (void)what, (void)kind, (void)where;
    return remove(path);
}

static void test_usb_adapters(void) {
    TEST_ASSERT_NOT_NULL(mkdtemp(sysfs));
    add_adapter("1-1", "0042");
    add_adapter("1-2.4", "twin");
    add_adapter("1-3", "twin");
    add_adapter("1-4", NULL);
    add_interface("can7", "280", "9", "1-1");
    add_interface("can3", "280", "12", "1-1"); // the second channel: made later, whatever it is called
    add_interface("can0", "280", "3", "1-2.4");
    add_interface("shaker", "280", "4", "1-3");
    add_interface("can1", "280", "5", "1-4");
    add_interface("vcan0", "280", "1", "");
    add_interface("eth0", "1", "2", "1-1"); // of a composite device: no CAN
    char name[16] = "kept";
    TEST_ASSERT_EQUAL_INT(0, drv_link_find(sysfs, "0042", 0, name));
    TEST_ASSERT_EQUAL_STRING("can7", name);
    TEST_ASSERT_EQUAL_INT(0, drv_link_find(sysfs, "0042", 1, name));
    TEST_ASSERT_EQUAL_STRING("can3", name);
    TEST_ASSERT_EQUAL_INT(-ENODEV, drv_link_find(sysfs, "0042", 2, name));
    TEST_ASSERT_EQUAL_INT(-ENODEV, drv_link_find(sysfs, "0042", -1, name));
    TEST_ASSERT_EQUAL_INT(-ENODEV, drv_link_find(sysfs, "004", 0, name));
    TEST_ASSERT_EQUAL_INT(-ENODEV, drv_link_find(sysfs, "", 0, name));
    TEST_ASSERT_EQUAL_STRING("can3", name);
    TEST_ASSERT_EQUAL_INT(-ENOTUNIQ, drv_link_find(sysfs, "twin", 0, name));
    TEST_ASSERT_EQUAL_INT(0, drv_link_find(sysfs, "1-2.4", 0, name));
    TEST_ASSERT_EQUAL_STRING("can0", name);
    TEST_ASSERT_EQUAL_INT(0, drv_link_find(sysfs, "1-4", 0, name));
    TEST_ASSERT_EQUAL_STRING("can1", name);
    drv_usb_t usb;
    TEST_ASSERT_EQUAL_INT(0, drv_link_usb(sysfs, "shaker", &usb));
    TEST_ASSERT_EQUAL_STRING("1-3", usb.port);
    TEST_ASSERT_EQUAL_STRING("twin", usb.serial);
    TEST_ASSERT_EQUAL_INT(0, drv_link_usb(sysfs, "can1", &usb));
    TEST_ASSERT_EQUAL_STRING("", usb.serial);
    TEST_ASSERT_EQUAL_INT(-ENODEV, drv_link_usb(sysfs, "vcan0", &usb));
    TEST_ASSERT_EQUAL_INT(-ENODEV, drv_link_find("/nowhere", "0042", 0, name));
    TEST_ASSERT_EQUAL_INT(0, nftw(sysfs, remove_one, 8, FTW_DEPTH | FTW_PHYS));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_every_field);
    RUN_TEST(test_states);
    RUN_TEST(test_other_kinds_have_no_can_data);
    RUN_TEST(test_cut_and_damaged_messages);
    RUN_TEST(test_questions_and_answers);
    RUN_TEST(test_news_of_one_interface);
    RUN_TEST(test_usb_adapters);
    return UNITY_END();
}
