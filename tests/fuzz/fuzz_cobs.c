// SPDX-License-Identifier: MIT
// A second time with the right sum, so that what lies behind it is reached too.
#include "decoder.h"

#include <drv/crc.h>
#include <drv/stream.h>

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    uint8_t plain[DRV_STREAM_MAX_BYTES], wire[DRV_STREAM_ENCODED + 2];
    fuzz_decoder(DRV_FRAMING_COBS, data, size);
    if (size > sizeof plain - 4) return 0;
    memcpy(plain, data, size);
    const uint32_t sum = drv_crc32(0, data, size);
    for (unsigned i = 0; i < 4; ++i) plain[size + i] = (uint8_t)(sum >> (8 * i));
    wire[0] = 0;
    wire[1] = 255;
    size_t used = 2 + drv_cobs_encode(plain, size + 4, wire + 2);
    wire[used++] = 0;
    fuzz_decoder(DRV_FRAMING_COBS, wire, used);
    return 0;
}
