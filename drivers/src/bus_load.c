// SPDX-License-Identifier: MIT
// PURPOSE  bits a CAN frame takes on the wire
// METHOD   the frame is walked four bits at a time: after five equal bits a stuff bit of the other value stands on the wire and
//          begins the next run; classic frames carry their CRC-15 through the same walk. FD frames are stuffed up to the last
//          data bit; their CRC field has a fixed stuff bit before the first bit and behind every fourth
// REFERENCE ISO 11898-1:2015, 10.4 (frames), 10.5 (stuffing); CRC-15 x^15+x^14+x^10+x^8+x^7+x^4+x^3+1
#include <drv/bus_load.h>

enum {
    TAIL_BITS = 1 + 2 + 7 + 3, ///< CRC delimiter, ACK and its delimiter, end of frame, gap to the next frame
    CRC_BITS = 15,
    CRC_POLYNOMIAL = 0x4599,
    FD_CRC17_BITS = 4 + 17 + 6, ///< stuff count, CRC, fixed stuff bits
    FD_CRC21_BITS = 4 + 21 + 7
};

typedef struct wire_t {
    uint32_t bits; ///< so far, stuff bits included
    uint32_t crc;
    uint32_t
        end; ///< 5 × last bit + length of the run of equal bits at the end - 1; a full run is stuffed when the next comes
} wire_t;

/// Start of frame: one bit 0, which leaves the CRC as it is.
static const wire_t start_of_frame = {1, 0, 0};

static void put_bit(wire_t* self, uint32_t bit) {
    static const uint8_t ends[10][2] = {// 16 more where a stuff bit came between
                                        {1, 5}, {2, 5}, {3, 5}, {4, 5}, {16, 22},
                                        {0, 6}, {0, 7}, {0, 8}, {0, 9}, {17, 21}};
    const uint32_t end = ends[self->end][bit], next = (self->crc >> (CRC_BITS - 1) ^ bit) & 1;
    self->bits += 1 + (end >> 4);
    self->end = end & 15;
    self->crc = (self->crc << 1 & 0x7FFF) ^ (next ? CRC_POLYNOMIAL : 0);
}

/// Four times put_bit().
static void put_four(wire_t* self, uint32_t bits) {
    static const uint8_t ends[10][16] = {{4, 5, 0, 6, 1, 5, 0, 7, 2, 5, 0, 6, 1, 5, 0, 8},
                                         {16, 22, 0, 6, 1, 5, 0, 7, 2, 5, 0, 6, 1, 5, 0, 8},
                                         {17, 21, 16, 23, 1, 5, 0, 7, 2, 5, 0, 6, 1, 5, 0, 8},
                                         {18, 21, 16, 22, 17, 21, 16, 24, 2, 5, 0, 6, 1, 5, 0, 8},
                                         {19, 21, 16, 22, 17, 21, 16, 23, 18, 21, 16, 22, 17, 21, 16, 25},
                                         {3, 5, 0, 6, 1, 5, 0, 7, 2, 5, 0, 6, 1, 5, 0, 9},
                                         {3, 5, 0, 6, 1, 5, 0, 7, 2, 5, 0, 6, 1, 5, 17, 21},
                                         {3, 5, 0, 6, 1, 5, 0, 7, 2, 5, 0, 6, 18, 21, 16, 22},
                                         {3, 5, 0, 6, 1, 5, 0, 7, 19, 21, 16, 22, 17, 21, 16, 23},
                                         {20, 21, 16, 22, 17, 21, 16, 23, 18, 21, 16, 22, 17, 21, 16, 24}};
    static const uint16_t crcs[16] = {0x0000, 0x4599, 0x4EAB, 0x0B32, 0x58CF, 0x1D56, 0x1664, 0x53FD,
                                      0x7407, 0x319E, 0x3AAC, 0x7F35, 0x2CC8, 0x6951, 0x6263, 0x27FA};
    const uint32_t end = ends[self->end][bits];
    self->bits += 4 + (end >> 4);
    self->end = end & 15;
    self->crc = (self->crc << 4 & 0x7FFF) ^ crcs[(self->crc >> (CRC_BITS - 4) ^ bits) & 15];
}

static void put(wire_t* self, uint32_t value, int count) {
    while (count & 3) put_bit(self, value >> --count & 1);
    while (count > 0) put_four(self, value >> (count -= 4) & 15);
}

static uint32_t length_code(unsigned len) {
    static const uint8_t steps[] = {12, 16, 20, 24, 32, 48};
    if (len <= 8) return len;
    uint32_t code = 9;
    for (unsigned i = 0; i < sizeof steps && len > steps[i]; ++i) ++code;
    return code;
}

/// Identifier; `last_bit` is RTR of a classic, RRS of an FD frame. Behind it stand IDE and `more`, `count` bits.
static void put_identifier(wire_t* self, const drv_frame_t* frame, uint32_t last_bit, uint32_t more, int count) {
    if (frame->flags & DRV_FRAME_EXTENDED) {
        put(self, frame->id >> 18 << 2 | 3, 13); // SRR, IDE
        put(self, (frame->id << 1 | last_bit) << count | more, 19 + count);
    } else {
        put(self, (frame->id << 2 | last_bit << 1) << count | more, 13 + count);
    }
}

static drv_wire_bits_t classic_bits(const drv_frame_t* frame) {
    uint32_t remote = (frame->flags & DRV_FRAME_REMOTE) != 0;
    unsigned len = frame->len < 8 ? frame->len : 8;
    wire_t wire = start_of_frame;
    put_identifier(&wire, frame, remote, len, frame->flags & DRV_FRAME_EXTENDED ? 6 : 5); // reserved, length
    if (!remote)
        for (unsigned i = 0; i < len; ++i) put(&wire, frame->data[i], 8);
    put(&wire, wire.crc, CRC_BITS);
    drv_wire_bits_t out = {wire.bits + (wire.end % 5 == 4) + TAIL_BITS, 0};
    return out;
}

static drv_wire_bits_t fd_bits(const drv_frame_t* frame) {
    int fast = (frame->flags & DRV_FRAME_BRS) != 0;
    unsigned len = frame->len < 64 ? frame->len : 64;
    wire_t wire = start_of_frame;
    put_identifier(&wire, frame, 0, fast ? 5 : 4, 3); // FDF, reserved, BRS
    const uint32_t arbitration = wire.bits;
    put(&wire, (frame->flags & DRV_FRAME_ESI) != 0, 1);
    put(&wire, length_code(len), 4);
    for (unsigned i = 0; i < len; ++i) put(&wire, frame->data[i], 8);
    const uint32_t rest = wire.bits - arbitration + (len > 16 ? FD_CRC21_BITS : FD_CRC17_BITS);
    drv_wire_bits_t out = {arbitration + TAIL_BITS + (fast ? 0 : rest), fast ? rest : 0};
    return out;
}

drv_wire_bits_t drv_wire_bits(const drv_frame_t* frame) {
    const drv_wire_bits_t none = {0, 0};
    if (frame->flags & DRV_FRAME_ERROR) return none;
    return frame->flags & DRV_FRAME_FD ? fd_bits(frame) : classic_bits(frame);
}

double drv_wire_seconds(const drv_frame_t* frame, double bitrate, double dbitrate) {
    drv_wire_bits_t bits = drv_wire_bits(frame);
    return bits.slow / bitrate + bits.fast / (dbitrate > 0 ? dbitrate : bitrate);
}
