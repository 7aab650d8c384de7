// SPDX-License-Identifier: MIT
// Lines to frames and back: what was parsed and is written again reads the same.
#include <drv/slcan.h>

#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    drv_frame_t frame, again;
    char line[DRV_SLCAN_BYTES + 1], text[512];
    int stamp_ms = 0;
    if (size > sizeof text) return 0;
    memcpy(text, data, size);
    memset(&frame, 0, sizeof frame);
    memset(&again, 0, sizeof again);
    if (drv_slcan_parse(text, size, &frame, &stamp_ms) != 1) return 0;
    if (stamp_ms < -1 || stamp_ms >= DRV_SLCAN_STAMP_MS || frame.len > 64) abort();
    const int length = drv_slcan_format(line, sizeof line, &frame);
    if (length < 1 || drv_slcan_parse(line, (size_t)length - 1, &again, &stamp_ms) != 1) abort();
    if (memcmp(&frame, &again, sizeof frame) != 0) abort();
    return 0;
}
