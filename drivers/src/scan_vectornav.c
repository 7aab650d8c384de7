// SPDX-License-Identifier: MIT
// PURPOSE  VectorNav's binary output to numbers: 0xFA, groups, a field word a group, payload, CRC-16-CCITT
// METHOD   the field words tell the length; the sum over everything behind 0xFA, itself included, is 0. After a wrong one
//          the search goes on one byte further
// REFERENCE VectorNav VN-100 user manual, binary output messages: groups 1 (common), 2 (time), 3 (IMU) and 5 (attitude)
#include <drv/crc.h>
#include <drv/decoder.h>

#include <math.h>
#include <string.h>

enum { SYNC = 0xFA, GROUPS = 5, FIELDS = 16, CRC_BYTES = 2 };

/// Bytes of each field; 0 = not known, such a packet cannot be cut.
static const uint8_t sizes[GROUPS][FIELDS] = {{8, 8, 8, 12, 16, 12, 24, 12, 12, 24, 20, 28, 2, 4, 8},
                                              {8, 8, 8, 2, 8, 8, 8, 4, 4, 1},
                                              {2, 12, 12, 12, 4, 4, 16, 12, 12, 12, 12, 2},
                                              {0},
                                              {2, 12, 16, 36, 12, 12, 12, 12, 12}};

/// A field that is delivered: where its three floats stand among ours; `rank` decides when several tell the same.
typedef struct wanted_t {
    uint8_t group, field, skip, first, rank;
} wanted_t;
static const wanted_t wanted[] = {{0, 8, 0, 0, 4}, {2, 9, 0, 0, 3},  {0, 9, 12, 0, 2}, {2, 2, 0, 0, 1},
                                  {0, 5, 0, 3, 4}, {2, 10, 0, 3, 3}, {0, 9, 0, 3, 2},  {2, 3, 0, 3, 1}};

static uint64_t get(const uint8_t* at, unsigned bytes) {
    uint64_t value = 0;
    for (unsigned i = bytes; i-- > 0;) value = value << 8 | at[i];
    return value;
}

static void take_field(unsigned group, unsigned field, const uint8_t* at, drv_packet_t* packet, uint8_t ranks[6]) {
    if (field == 0 && group <= 1) { // TimeStartup, ns
        packet->time_ns = get(at, 8);
        packet->time_bits = 64;
        packet->timed = 1;
    }
    for (size_t k = 0; k < sizeof wanted / sizeof wanted[0]; ++k) {
        const wanted_t* each = &wanted[k];
        if (each->group != group || each->field != field || ranks[each->first] > each->rank) continue;
        ranks[each->first] = each->rank;
        for (unsigned i = 0; i < 3; ++i) {
            const uint32_t bits = (uint32_t)get(at + each->skip + (size_t)4 * i, 4);
            float value;
            memcpy(&value, &bits, sizeof value);
            packet->values[each->first + i] = value;
        }
    }
}

/// Length of header and payload. @return 0 when more bytes are needed, -1 when the header cannot be one of ours
static ptrdiff_t measure(const uint8_t* bytes, size_t count) {
    if (count < 2) return 0;
    const unsigned groups = bytes[1];
    if (groups == 0 || groups >= 1u << GROUPS) return -1;
    size_t at = 2, payload = 0;
    for (unsigned g = 0; g < GROUPS; ++g) {
        if (!(groups >> g & 1)) continue;
        if (count < at + 2) return 0;
        const unsigned fields = (unsigned)get(bytes + at, 2);
        at += 2;
        if (fields == 0) return -1;
        for (unsigned f = 0; f < FIELDS; ++f) {
            if (!(fields >> f & 1)) continue;
            if (sizes[g][f] == 0) return -1;
            payload += sizes[g][f];
        }
    }
    return (ptrdiff_t)(at + payload);
}

static int take(const uint8_t* bytes, drv_packet_t* packet) {
    uint8_t ranks[6] = {0};
    const uint8_t* words = bytes + 2;
    const uint8_t* at = words;
    for (unsigned g = 0; g < GROUPS; ++g) at += bytes[1] >> g & 1 ? 2 : 0;
    packet->counted = packet->timed = 0;
    packet->first_field = 0;
    packet->fields = 6;
    packet->samples = 1;
    for (unsigned i = 0; i < 6; ++i) packet->values[i] = NAN;
    for (unsigned g = 0; g < GROUPS; ++g) {
        if (!(bytes[1] >> g & 1)) continue;
        const unsigned fields = (unsigned)get(words, 2);
        words += 2;
        for (unsigned f = 0; f < FIELDS; ++f) {
            if (!(fields >> f & 1)) continue;
            take_field(g, f, at, packet, ranks);
            at += sizes[g][f];
        }
    }
    return ranks[0] || ranks[3];
}

drv_scan_t drv_scan_vectornav(const uint8_t* bytes, size_t count, drv_packet_t* packet, size_t* used) {
    const uint8_t* sync = memchr(bytes, SYNC, count);
    *used = sync ? (size_t)(sync - bytes) : count;
    if (*used > 0) return DRV_SCAN_NOISE;
    const ptrdiff_t length = measure(bytes, count);
    if (length < 0) {
        *used = 1;
        return DRV_SCAN_NOISE;
    }
    if (length == 0 || count < (size_t)length + CRC_BYTES) return DRV_SCAN_MORE;
    if (drv_crc16_ccitt(0, bytes + 1, (size_t)length - 1 + CRC_BYTES) != 0) {
        *used = 1;
        return DRV_SCAN_DAMAGED;
    }
    *used = (size_t)length + CRC_BYTES;
    return take(bytes, packet) ? DRV_SCAN_PACKET : DRV_SCAN_IDLE;
}
