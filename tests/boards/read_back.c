// SPDX-License-Identifier: MIT
// PURPOSE  packets on the standard input to lines of text by okid's own decoder: number of the sample, time of the packet in
//          microseconds, codes; 1 where anything was refused
#include <drv/decoder.h>

#include <stdio.h>

int main(void) {
    static drv_decoder_t decoder;
    drv_decoder_init(&decoder, DRV_FRAMING_COBS, 0);
    uint8_t* at;
    for (size_t count; (count = drv_decoder_room(&decoder, &at)) > 0;) {
        if ((count = fread(at, 1, count, stdin)) == 0) break;
        drv_decoder_add(&decoder, count);
        while (drv_decoder_next(&decoder)) {
            const drv_packet_t* p = &decoder.packet;
            for (unsigned n = 0; n < p->samples; ++n) {
                printf("%u %llu", p->sequence + n, (unsigned long long)p->time_ns / 1000);
                for (unsigned c = 0; c < p->fields; ++c) printf(" %.0f", p->values[n * p->fields + c]);
                printf("\n");
            }
        }
    }
    return decoder.damaged > 0;
}
