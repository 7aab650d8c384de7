// SPDX-License-Identifier: MIT
// A second time with the right sum, so that what lies behind it is reached too.
#include "decoder.h"

#include <drv/crc.h>

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    uint8_t packet[1024] = {0, 255, 0xFA};
    fuzz_decoder(DRV_FRAMING_VECTORNAV, data, size);
    if (size > sizeof packet - 5) return 0;
    memcpy(packet + 3, data, size);
    const uint16_t sum = drv_crc16_ccitt(0, data, size);
    packet[3 + size] = (uint8_t)(sum >> 8);
    packet[4 + size] = (uint8_t)sum;
    fuzz_decoder(DRV_FRAMING_VECTORNAV, packet, size + 5);
    return 0;
}
