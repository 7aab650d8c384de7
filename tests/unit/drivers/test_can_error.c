// SPDX-License-Identifier: MIT
#include <drv/can_error.h>

#include <linux/can/error.h>
#include <string.h>
#include <unity.h>

static drv_stats_t counts;

void setUp(void) { memset(&counts, 0, sizeof counts); }
void tearDown(void) {}

static void take(uint32_t id, uint8_t controller, uint8_t protocol, uint8_t tx, uint8_t rx) {
    const uint8_t data[8] = {0, controller, protocol, 0, 0, 0, tx, rx};
    drv_can_error_count(&counts, id, data);
}

static void test_bus_off_and_back(void) {
    take(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING, 0, 100, 0);
    TEST_ASSERT_EQUAL_INT(DRV_BUS_WARNING, counts.state);
    take(CAN_ERR_CRTL | CAN_ERR_ACK, CAN_ERR_CRTL_TX_PASSIVE, 0, 128, 3);
    TEST_ASSERT_EQUAL_INT(DRV_BUS_PASSIVE, counts.state);
    TEST_ASSERT_EQUAL_STRING(
        "no acknowledgement: is another node on the bus?; error-passive by send errors (tx errors 128, rx errors 3)",
        counts.last_error);
    take(CAN_ERR_BUSOFF, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_INT(DRV_BUS_OFF, counts.state);
    TEST_ASSERT_EQUAL_STRING("bus-off", counts.last_error);
    take(CAN_ERR_RESTARTED, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_INT(DRV_BUS_ACTIVE, counts.state);
    take(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE, 0, 0, 0);
    take(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE, 0, 0, 0);
    TEST_ASSERT_EQUAL_INT(DRV_BUS_ACTIVE, counts.state);
    TEST_ASSERT_EQUAL_UINT64(6, counts.error_frames);
    TEST_ASSERT_EQUAL_UINT64(1, counts.bus_off);
    TEST_ASSERT_EQUAL_UINT64(1, counts.restarts);
    TEST_ASSERT_EQUAL_UINT64(1, counts.no_ack);
    TEST_ASSERT_EQUAL_UINT64(2, counts.error_passive);
}

static void test_the_other_classes(void) {
    take(CAN_ERR_TX_TIMEOUT, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_STRING("sending timed out", counts.last_error);
    take(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW | CAN_ERR_CRTL_TX_OVERFLOW, 0, 0, 0);
    TEST_ASSERT_EQUAL_STRING("receive queue overran; send queue overran", counts.last_error);
    take(CAN_ERR_PROT | CAN_ERR_BUSERROR, 0, CAN_ERR_PROT_STUFF | CAN_ERR_PROT_TX, 0, 0);
    TEST_ASSERT_EQUAL_STRING("stuff error; while sending", counts.last_error);
    take(CAN_ERR_BUSERROR, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_STRING("bus error", counts.last_error);
    take(CAN_ERR_LOSTARB | CAN_ERR_TRX, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_STRING("arbitration lost; transceiver or wiring fault", counts.last_error);
    take(0, 0, 0, 0, 0);
    TEST_ASSERT_EQUAL_STRING("error without a class", counts.last_error);
    TEST_ASSERT_EQUAL_UINT64(1, counts.tx_timeouts);
    TEST_ASSERT_EQUAL_UINT64(1, counts.rx_overflows);
    TEST_ASSERT_EQUAL_UINT64(2, counts.bus_errors);
    TEST_ASSERT_EQUAL_UINT64(0, counts.error_passive);
    TEST_ASSERT_EQUAL_INT(DRV_BUS_UNKNOWN, counts.state);
}

static void test_detail_bytes_of_other_classes_are_not_read(void) {
    take(CAN_ERR_BUSOFF, 0xFF, 0xFF, 0, 0);
    TEST_ASSERT_EQUAL_STRING("bus-off", counts.last_error);
    TEST_ASSERT_EQUAL_UINT64(0, counts.rx_overflows + counts.error_passive + counts.bus_errors);
}

static void test_text_is_cut_to_its_room(void) {
    const uint8_t data[8] = {0, 0xFF, 0xFF, 0, 0, 0, 255, 255};
    char text[40];
    for (size_t room = 0; room < sizeof text; ++room) {
        memset(text, '#', sizeof text);
        drv_can_error_text(0x3FF, data, text, room);
        if (room) TEST_ASSERT_EQUAL_UINT64(room - 1, strlen(text));
        TEST_ASSERT_EQUAL_INT('#', text[room]);
    }
    take(0x1FFFFFFF, 0xFF, 0xFF, 255, 255);
    TEST_ASSERT_EQUAL_UINT64(DRV_ERROR_TEXT_BYTES - 1, strlen(counts.last_error));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_bus_off_and_back);
    RUN_TEST(test_the_other_classes);
    RUN_TEST(test_detail_bytes_of_other_classes_are_not_read);
    RUN_TEST(test_text_is_cut_to_its_room);
    return UNITY_END();
}
