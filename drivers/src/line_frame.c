// SPDX-License-Identifier: MIT
// PURPOSE  samples off a serial line as frames
// METHOD   one fixed layout that the codec of CAN signals reads
#include <drv/line_frame.h>

#include <math.h>
#include <string.h>

static void put(uint8_t* at, uint64_t value, unsigned bytes) {
    for (unsigned i = 0; i < bytes; ++i) at[i] = (uint8_t)(value >> (8 * i));
}

uint32_t drv_line_frame_field(drv_framing_t framing, unsigned field, drv_signal_t* signal) {
    const unsigned together = drv_framings[framing].fields;
    memset(signal, 0, sizeof *signal);
    signal->start_bit = (uint16_t)(64 * (1 + field % together));
    signal->length = 64;
    signal->value = DRV_VALUE_FLOAT64;
    signal->scale = 1;
    (void)drv_signal_prepare(signal);
    return field / together;
}

void drv_line_frame_counter(unsigned bits, drv_signal_t* signal) {
    memset(signal, 0, sizeof *signal);
    signal->length = (uint16_t)bits;
    signal->scale = 1;
    (void)drv_signal_prepare(signal);
}

void drv_line_frame_fill(drv_frame_t* frame, uint32_t id, uint32_t sequence, const double* values, unsigned count) {
    frame->id = id;
    frame->flags = DRV_FRAME_FD;
    frame->len = DRV_LINE_FRAME_BYTES;
    put(frame->data, sequence, 8);
    for (unsigned i = 0; i < DRV_LINE_FRAME_FIELDS; ++i) {
        const double value = i < count ? values[i] : NAN;
        uint64_t bits;
        memcpy(&bits, &value, sizeof bits);
        put(frame->data + 8 + (size_t)8 * i, bits, 8);
    }
}
