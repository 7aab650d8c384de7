// SPDX-License-Identifier: MIT
// PURPOSE  check sums of the serial protocols
// METHOD   CRC-32 by a table of 16 entries (64 bytes), CRC-16-CCITT by shifts: small enough for a node, fast enough here
#include <drv/crc.h>

uint32_t drv_crc32(uint32_t before, const uint8_t* bytes, size_t count) {
    static const uint32_t nibble[16] = {0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4,
                                        0x4DB26158, 0x5005713C, 0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C,
                                        0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};
    uint32_t sum = ~before;
    for (size_t i = 0; i < count; ++i) {
        sum ^= bytes[i];
        sum = nibble[sum & 15] ^ (sum >> 4);
        sum = nibble[sum & 15] ^ (sum >> 4);
    }
    return ~sum;
}

uint16_t drv_crc16_ccitt(uint16_t before, const uint8_t* bytes, size_t count) {
    unsigned sum = before;
    for (size_t i = 0; i < count; ++i) {
        sum = (sum >> 8 | sum << 8) & 0xFFFFu;
        sum ^= bytes[i];
        sum ^= (sum & 0xFFu) >> 4;
        sum = (sum ^ sum << 12) & 0xFFFFu;
        sum = (sum ^ (sum & 0xFFu) << 5) & 0xFFFFu;
    }
    return (uint16_t)sum;
}
