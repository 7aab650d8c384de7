// SPDX-License-Identifier: MIT
// PURPOSE  bits a CAN frame takes on the wire
// METHOD   the frame is walked bit by bit: after five equal bits a stuff bit of the other value stands on the wire and begins
//          the next run; classic frames carry their CRC-15 through the same walk. FD frames are stuffed up to the last
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
    int run, last; ///< equal bits at the end; a full run is stuffed when the next bit comes
} wire_t;

static void put_bit(wire_t* self, int bit) {
    if (self->run == 5) {
        ++self->bits;
        self->last = !self->last;
        self->run = 1;
    }
    ++self->bits;
    self->run = bit == self->last ? self->run + 1 : 1;
    self->last = bit;
    uint32_t next = (self->crc >> (CRC_BITS - 1) ^ (uint32_t)bit) & 1;
    self->crc = (self->crc << 1 & 0x7FFF) ^ (next ? CRC_POLYNOMIAL : 0);
}

static void put(wire_t* self, uint32_t value, int count) {
    while (count-- > 0) put_bit(self, (int)(value >> count & 1));
}

static uint32_t length_code(unsigned len) {
    static const uint8_t steps[] = {12, 16, 20, 24, 32, 48};
    if (len <= 8) return len;
    uint32_t code = 9;
    for (unsigned i = 0; i < sizeof steps && len > steps[i]; ++i) ++code;
    return code;
}

/// Start of frame and identifier; `last_bit` is RTR of a classic, RRS of an FD frame.
static void put_identifier(wire_t* self, const drv_frame_t* frame, uint32_t last_bit) {
    put(self, 0, 1);
    if (frame->flags & DRV_FRAME_EXTENDED) {
        put(self, frame->id >> 18, 11);
        put(self, 3, 2); // SRR, IDE
        put(self, frame->id, 18);
        put(self, last_bit, 1);
    } else {
        put(self, frame->id, 11);
        put(self, last_bit, 1);
        put(self, 0, 1); // IDE
    }
}

static drv_wire_bits_t classic_bits(const drv_frame_t* frame) {
    int remote = (frame->flags & DRV_FRAME_REMOTE) != 0;
    unsigned len = frame->len < 8 ? frame->len : 8;
    wire_t wire = {0, 0, 0, -1};
    put_identifier(&wire, frame, (uint32_t)remote);
    put(&wire, 0, frame->flags & DRV_FRAME_EXTENDED ? 2 : 1); // reserved
    put(&wire, len, 4);
    if (!remote)
        for (unsigned i = 0; i < len; ++i) put(&wire, frame->data[i], 8);
    put(&wire, wire.crc, CRC_BITS);
    drv_wire_bits_t out = {wire.bits + (wire.run == 5) + TAIL_BITS, 0};
    return out;
}

static drv_wire_bits_t fd_bits(const drv_frame_t* frame) {
    int fast = (frame->flags & DRV_FRAME_BRS) != 0;
    unsigned len = frame->len < 64 ? frame->len : 64;
    wire_t wire = {0, 0, 0, -1};
    put_identifier(&wire, frame, 0);
    put(&wire, 2, 2); // FDF, reserved
    put(&wire, (uint32_t)fast, 1);
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
