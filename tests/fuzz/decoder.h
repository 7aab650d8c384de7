// SPDX-License-Identifier: MIT
// Any bytes, in pieces of any length, through the decoder of a framing.
#ifndef OKID_FUZZ_DECODER_H
#define OKID_FUZZ_DECODER_H

#include <drv/decoder.h>

#include <stdlib.h>
#include <string.h>

static inline void fuzz_decoder(drv_framing_t framing, const uint8_t* data, size_t size) {
    static drv_decoder_t decoder;
    if (size < 2) return;
    drv_decoder_init(&decoder, framing, framing == DRV_FRAMING_ASCII ? data[0] % 4 : 0);
    const size_t piece = 1 + (size_t)data[1] * 8;
    for (size_t at = 2; at < size;) {
        uint8_t* room = NULL;
        size_t count = drv_decoder_room(&decoder, &room);
        if (count == 0) abort(); // the decoder would stand still
        if (count > piece) count = piece;
        if (count > size - at) count = size - at;
        memcpy(room, data + at, count);
        drv_decoder_add(&decoder, count);
        at += count;
        while (drv_decoder_next(&decoder)) {
            const drv_packet_t* packet = &decoder.packet;
            if (packet->fields == 0 || packet->samples == 0 ||
                (size_t)packet->fields * packet->samples > DRV_PACKET_VALUES ||
                packet->first_field + packet->fields > (int)drv_framings[framing].limit)
                abort();
        }
    }
}

#endif
