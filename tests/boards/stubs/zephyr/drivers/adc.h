// SPDX-License-Identifier: MIT
/// @file adc.h
/// As much of Zephyr's ADC interface as the sample calls: codes of codes.h, channel by channel.
#ifndef STUB_ADC_H
#define STUB_ADC_H

#include <zephyr/kernel.h>

#include <stdbool.h>
#include <string.h>

#define DT_PATH(node) 0
struct adc_dt_spec {
    int channel;
};
#define ADC_DT_SPEC_GET_BY_IDX(node, index) {(node) + (index)}
struct adc_sequence {
    void* buffer;
    size_t buffer_size;
};
static inline bool adc_is_ready_dt(const struct adc_dt_spec* spec) { return spec->channel >= 0; }
static inline int adc_channel_setup_dt(const struct adc_dt_spec* spec) { return spec->channel < 0; }
static inline int adc_sequence_init_dt(const struct adc_dt_spec* spec, struct adc_sequence* sequence) {
    (void)spec, (void)sequence;
    return 0;
}
static inline int adc_read_dt(const struct adc_dt_spec* spec, const struct adc_sequence* sequence) {
    memcpy(sequence->buffer, &codes[stub_reads++ / CHANNELS_STUB][spec->channel], sequence->buffer_size);
    return 0;
}

#endif
