// SPDX-License-Identifier: MIT
// Streams 1 force and 3 accelerations at 1 kHz as COBS packets on the console's UART; okid reads them: framing = "cobs".
// The board's overlay names the channels: / { zephyr,user { io-channels = <&adc1 0>, <&adc1 1>, <&adc1 2>, <&adc1 3>; }; };
#include <okid_core.h>
#include <zephyr/drivers/adc.h>
#include <zephyr/drivers/uart.h>
#include <zephyr/kernel.h>

enum { CHANNELS = 4, EACH = 8 }; // samples of a packet
static const struct adc_dt_spec inputs[CHANNELS] = {
    ADC_DT_SPEC_GET_BY_IDX(DT_PATH(zephyr_user), 0), ADC_DT_SPEC_GET_BY_IDX(DT_PATH(zephyr_user), 1),
    ADC_DT_SPEC_GET_BY_IDX(DT_PATH(zephyr_user), 2), ADC_DT_SPEC_GET_BY_IDX(DT_PATH(zephyr_user), 3)};
static const struct device* const line = DEVICE_DT_GET(DT_CHOSEN(zephyr_console));
static struct k_timer every;
static uint8_t packet[DRV_STREAM_ENCODED];

static int32_t read_code(int channel) {
    int16_t code = 0;
    struct adc_sequence sequence = {.buffer = &code, .buffer_size = sizeof code};
    (void)adc_sequence_init_dt(&inputs[channel], &sequence);
    return adc_read_dt(&inputs[channel], &sequence) < 0 ? INT16_MIN : code; // full scale: okid counts it
}

int main(void) {
    for (int c = 0; c < CHANNELS; ++c)
        if (!adc_is_ready_dt(&inputs[c]) || adc_channel_setup_dt(&inputs[c]) < 0) return 0;
    k_timer_init(&every, NULL, NULL);
    k_timer_start(&every, K_MSEC(1), K_MSEC(1));
    drv_stream_header_t header = {.format = DRV_STREAM_INT16, .channels = CHANNELS, .samples = EACH};
    for (;;) {
        int32_t codes[CHANNELS * EACH];
        for (int n = 0; n < EACH; ++n) {
            const uint32_t due = k_timer_status_sync(&every); // above 1: a tick was missed
            if (n > 0 && due > 1) { // the packet would hide it: begin again, the sample numbers show the gap
                header.sequence += (uint32_t)n + due - 1;
                n = 0;
            } else if (due > 1) {
                header.sequence += due - 1;
            }
            if (n == 0) header.time_us = k_cyc_to_us_floor32(k_cycle_get_32());
            for (int c = 0; c < CHANNELS; ++c) codes[n * CHANNELS + c] = read_code(c);
        }
        const size_t bytes = drv_stream_encode_codes(&header, codes, packet, sizeof packet);
        for (size_t i = 0; i < bytes; ++i) uart_poll_out(line, packet[i]);
        header.sequence += EACH;
    }
}
