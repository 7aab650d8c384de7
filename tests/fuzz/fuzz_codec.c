// SPDX-License-Identifier: MIT
// Any layout of a signal in any frame: what is put comes out again and touches no other bit.
#include <drv/codec.h>

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

static unsigned different_bits(const uint8_t* a, const uint8_t* b) {
    unsigned count = 0;
    for (int i = 0; i < 64; ++i)
        for (unsigned rest = a[i] ^ b[i]; rest; rest &= rest - 1) ++count;
    return count;
}

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    if (size < 16) return 0;
    drv_signal_t signal;
    memset(&signal, 0, sizeof signal);
    signal.start_bit = (uint16_t)(data[0] | data[1] << 8);
    signal.length = data[2];
    signal.big_endian = data[3] & 1;
    signal.is_signed = data[3] >> 1 & 1;
    signal.value = (drv_value_t)(data[3] >> 2 & 3);
    memcpy(&signal.scale, data + 4, 8);
    signal.offset = data[12] - 128.0;
    const size_t len = data[13] % 65;
    if (drv_signal_prepare(&signal) != NULL) return 0;
    uint8_t frame[64] = {0}, before[64];
    memcpy(frame, data + 14, size - 14 < 64 ? size - 14 : 64);
    memcpy(before, frame, sizeof frame);
    int64_t raw = 0, again = 0;
    double physical = 0;
    const int there = drv_signal_raw(&signal, frame, len, &raw);
    if (there != (drv_signal_bytes(&signal) <= len)) abort();
    (void)drv_signal_number(&signal, raw);
    if (!there) return 0;
    if (!drv_signal_decode(&signal, frame, len, &physical)) abort();
    if (!drv_signal_put(&signal, frame, len, raw) || memcmp(frame, before, sizeof frame) != 0) abort();
    if (!drv_signal_put(&signal, frame, len, ~raw) || !drv_signal_raw(&signal, frame, len, &again)) abort();
    if (again != ~raw && signal.is_signed && signal.value == DRV_VALUE_INTEGER) abort();
    if (different_bits(frame, before) != signal.length) abort();
    (void)drv_signal_encode(&signal, frame, len, physical);
    return 0;
}
