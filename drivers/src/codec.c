// SPDX-License-Identifier: MIT
// PURPOSE  bits of a frame <-> numbers
// METHOD   at most nine bytes hold a signal of up to 64 bits: eight of them are one 64-bit load (little-endian, or byte
//          swapped for big-endian signals), the ninth is added only where the signal straddles it
#include <drv/codec.h>

#include <math.h>
#include <string.h>

const char* drv_signal_prepare(drv_signal_t* self) {
    if (self->length < 1 || self->length > 64) return "a signal has 1 to 64 bits";
    if (self->start_bit > 511) return "the start bit must be below 512 (64 bytes)";
    if (self->value == DRV_VALUE_FLOAT32 && self->length != 32) return "a float32 signal has 32 bits";
    if (self->value == DRV_VALUE_FLOAT64 && self->length != 64) return "a float64 signal has 64 bits";
    unsigned begin = self->start_bit, end;
    if (self->big_endian) begin = (begin / 8) * 8 + (7 - begin % 8); // counted from the first bit on the wire
    end = begin + self->length - 1;
    if (end > 511) return "the signal ends beyond byte 64";
    self->first = (uint8_t)(begin / 8);
    self->bytes = (uint8_t)(end / 8 - begin / 8 + 1);
    self->shift = (uint8_t)(self->big_endian ? 7 - end % 8 : begin % 8);
    self->mask = self->length == 64 ? UINT64_MAX : (((uint64_t)1 << self->length) - 1);
    return NULL;
}

size_t drv_signal_bytes(const drv_signal_t* self) { return (size_t)self->first + self->bytes; }

/// Up to eight bytes as one number, the first byte least (little) or most (big) significant.
static uint64_t load(const uint8_t* bytes, unsigned count, int big_endian) {
    uint64_t value = 0;
    if (big_endian)
        for (unsigned i = 0; i < count; ++i) value = value << 8 | bytes[i];
    else
        for (unsigned i = count; i-- > 0;) value = value << 8 | bytes[i];
    return value;
}

int drv_signal_raw(const drv_signal_t* self, const uint8_t* data, size_t len, int64_t* raw) {
    if (drv_signal_bytes(self) > len) return 0;
    const uint8_t* at = data + self->first;
    uint64_t bits;
    if (self->bytes <= 8) {
        bits = load(at, self->bytes, self->big_endian) >> self->shift;
    } else if (self->big_endian) {
        bits = load(at, 8, 1) << (8 - self->shift) | (uint64_t)(at[8] >> self->shift);
    } else {
        bits = load(at, 8, 0) >> self->shift | (uint64_t)at[8] << (64 - self->shift);
    }
    bits &= self->mask;
    if (self->is_signed && self->value == DRV_VALUE_INTEGER && (bits >> (self->length - 1) & 1)) bits |= ~self->mask;
    memcpy(raw, &bits, sizeof bits);
    return 1;
}

double drv_signal_number(const drv_signal_t* self, int64_t raw) {
    if (self->value == DRV_VALUE_FLOAT32) {
        uint32_t bits = (uint32_t)raw;
        float value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    if (self->value == DRV_VALUE_FLOAT64) {
        double value;
        memcpy(&value, &raw, sizeof value);
        return value;
    }
    return self->is_signed ? (double)raw : (double)(uint64_t)raw;
}

int drv_signal_decode(const drv_signal_t* self, const uint8_t* data, size_t len, double* physical) {
    int64_t raw;
    if (!drv_signal_raw(self, data, len, &raw)) return 0;
    *physical = drv_signal_number(self, raw) * self->scale + self->offset;
    return 1;
}

int drv_signal_put(const drv_signal_t* self, uint8_t* data, size_t len, int64_t raw) {
    if (drv_signal_bytes(self) > len) return 0;
    uint64_t bits = (uint64_t)raw & self->mask;
    unsigned done = 0; // from the least significant bit upwards
    while (done < self->length) {
        unsigned place = done + self->shift;
        unsigned byte = self->big_endian ? self->bytes - 1 - place / 8 : place / 8;
        unsigned low = place % 8;
        unsigned count = 8 - low;
        if (count > self->length - done) count = self->length - done;
        uint8_t window = (uint8_t)(((1u << count) - 1) << low);
        uint8_t* at = data + self->first + byte;
        *at = (uint8_t)((*at & ~window) | ((bits >> done << low) & window));
        done += count;
    }
    return 1;
}

int drv_signal_encode(const drv_signal_t* self, uint8_t* data, size_t len, double physical) {
    double number = (physical - self->offset) / self->scale;
    int64_t raw = 0;
    int verdict = 1;
    if (self->value == DRV_VALUE_FLOAT32) {
        float value = (float)number;
        uint32_t bits;
        memcpy(&bits, &value, sizeof bits);
        raw = bits;
    } else if (self->value == DRV_VALUE_FLOAT64) {
        memcpy(&raw, &number, sizeof raw);
    } else {
        if (isnan(number)) return 0;
        int64_t most = (int64_t)(self->is_signed ? self->mask >> 1 : self->mask);
        int64_t least = self->is_signed ? -most - 1 : 0;
        double rounded = nearbyint(number);
        double top = self->is_signed ? (double)most : (double)self->mask;
        if (rounded >= top) {
            verdict = rounded > top ? 2 : 1;
            raw = most; // unsigned 64 bits: the pattern of all ones
        } else if (rounded <= (double)least) {
            verdict = rounded < (double)least ? 2 : 1;
            raw = least;
        } else {
            raw = self->is_signed ? (int64_t)rounded : (int64_t)(uint64_t)rounded;
        }
    }
    return drv_signal_put(self, data, len, raw) ? verdict : 0;
}
