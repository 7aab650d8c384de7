// SPDX-License-Identifier: MIT
// PURPOSE  samples to packets of the project's own serial stream (the node's side)
// METHOD   the plain packet is laid out at the end of the caller's room, then stuffed towards its beginning
#include <drv/crc.h>
#include <drv/stream.h>

#include <string.h>

static unsigned number_bytes(drv_stream_format_t format) {
    return format == DRV_STREAM_INT16 ? 2 : format == DRV_STREAM_INT24 ? 3 : 4;
}

static size_t plain_bytes(const drv_stream_header_t* header) {
    return DRV_STREAM_OVERHEAD + (size_t)header->channels * header->samples * number_bytes(header->format);
}

size_t drv_stream_bytes(const drv_stream_header_t* header) {
    if (header->format > DRV_STREAM_FLOAT32 || header->channels == 0 || header->samples == 0) return 0;
    size_t plain = plain_bytes(header);
    return plain > DRV_STREAM_MAX_BYTES ? 0 : DRV_COBS_BYTES(plain) + 1;
}

static uint8_t* put(uint8_t* at, uint32_t value, unsigned bytes) {
    for (unsigned i = 0; i < bytes; ++i) at[i] = (uint8_t)(value >> (8 * i));
    return at + bytes;
}

static uint8_t* put_header(uint8_t* at, const drv_stream_header_t* header) {
    *at++ = DRV_STREAM_VERSION;
    *at++ = (uint8_t)header->format;
    *at++ = header->channels;
    *at++ = header->samples;
    at = put(at, header->sequence, 4);
    return put(at, header->time_us, 4);
}

static size_t finish(uint8_t* plain, uint8_t* end, uint8_t* out) {
    end = put(end, drv_crc32(0, plain, (size_t)(end - plain)), 4);
    size_t used = drv_cobs_encode(plain, (size_t)(end - plain), out);
    out[used] = 0;
    return used + 1;
}

size_t drv_stream_encode_codes(const drv_stream_header_t* header, const int32_t* codes, uint8_t* out, size_t capacity) {
    size_t need = drv_stream_bytes(header);
    if (need == 0 || need > capacity || header->format == DRV_STREAM_FLOAT32) return 0;
    uint8_t* plain = out + (need - 1 - plain_bytes(header));
    uint8_t* at = put_header(plain, header);
    size_t count = (size_t)header->channels * header->samples;
    for (size_t i = 0; i < count; ++i) at = put(at, (uint32_t)codes[i], number_bytes(header->format));
    return finish(plain, at, out);
}

size_t drv_stream_encode_floats(const drv_stream_header_t* header, const float* values, uint8_t* out, size_t capacity) {
    size_t need = drv_stream_bytes(header);
    if (need == 0 || need > capacity || header->format != DRV_STREAM_FLOAT32) return 0;
    uint8_t* plain = out + (need - 1 - plain_bytes(header));
    uint8_t* at = put_header(plain, header);
    size_t count = (size_t)header->channels * header->samples;
    for (size_t i = 0; i < count; ++i) {
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        at = put(at, bits, 4);
    }
    return finish(plain, at, out);
}
