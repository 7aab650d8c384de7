// SPDX-License-Identifier: MIT
// PURPOSE  bytes of the UART to packets and back, with the codec of drivers/ and one static room for both ways
// METHOD   a packet is unstuffed in place; its codes stand 12 bytes into the room, aligned, and are used there
#include "link.h"

#include "board.h"

#include <drv/crc.h>

#include <string.h>

enum { PART_HEADER = 3, SUM = 4, COMMAND_BYTES = 1 + SUM };

static _Alignas(8) uint8_t room[DRV_STREAM_ENCODED];
static uint32_t spent;

static uint32_t get(const uint8_t* at, unsigned bytes) {
    uint32_t value = 0;
    for (unsigned i = bytes; i-- > 0;) value = value << 8 | at[i];
    return value;
}

/// Bytes up to the next 0, 0 when they were more than a packet may have.
static size_t receive_line(void) {
    size_t count = 0;
    for (;;) {
        const uint8_t byte = board_read();
        if (byte == 0) return count <= sizeof room ? count : 0;
        if (count < sizeof room) room[count] = byte;
        ++count;
    }
}

static link_event_t take(size_t stuffed, unsigned channels, link_samples_t* samples, uint8_t* command) {
    const ptrdiff_t size = drv_cobs_decode(room, stuffed, room);
    if (size < COMMAND_BYTES || drv_crc32(0, room, (size_t)size - SUM) != get(room + size - SUM, SUM))
        return LINK_DAMAGED;
    if (size == COMMAND_BYTES && room[0] >= LINK_RESET) {
        *command = room[0];
        return LINK_COMMAND;
    }
    if (size < DRV_STREAM_OVERHEAD || room[0] != DRV_STREAM_VERSION || room[1] != DRV_STREAM_INT16) return LINK_DAMAGED;
    if (room[2] != channels || (size_t)size != DRV_STREAM_OVERHEAD + 2u * room[2] * room[3]) return LINK_DAMAGED;
    samples->count = room[3];
    samples->sequence = get(room + 4, 4);
    int16_t* codes = (int16_t*)(void*)(room + DRV_STREAM_HEADER);
    for (size_t i = 0; i < (size_t)room[2] * room[3]; ++i) codes[i] = (int16_t)get(room + DRV_STREAM_HEADER + 2 * i, 2);
    samples->codes = codes;
    return LINK_SAMPLES;
}

link_event_t link_receive(unsigned channels, link_samples_t* samples, uint8_t* command) {
    size_t stuffed = 0;
    while (stuffed == 0) stuffed = receive_line();
    const uint32_t start = board_ticks();
    const link_event_t event = take(stuffed, channels, samples, command);
    if (event == LINK_SAMPLES) spent += board_ticks() - start;
    return event;
}

uint32_t link_ticks(void) { return spent; }

static void send_part(uint8_t kind, unsigned part, const uint8_t* bytes, size_t count) {
    const size_t plain_bytes = PART_HEADER + count + SUM;
    uint8_t* plain = room + sizeof room - plain_bytes; // stuffed towards the beginning of the same room
    plain[0] = kind;
    plain[1] = (uint8_t)part;
    plain[2] = (uint8_t)(part >> 8);
    memcpy(plain + PART_HEADER, bytes, count);
    const uint32_t sum = drv_crc32(0, plain, plain_bytes - SUM);
    for (unsigned i = 0; i < SUM; ++i) plain[plain_bytes - SUM + i] = (uint8_t)(sum >> (8 * i));
    const size_t size = drv_cobs_encode(plain, plain_bytes, room);
    for (size_t i = 0; i < size; ++i) board_write(room[i]);
    board_write(0);
}

void link_report(uint8_t kind, const uint8_t* bytes, size_t count) {
    unsigned part = 0;
    do {
        const size_t now = count < LINK_PAYLOAD ? count : LINK_PAYLOAD;
        send_part(kind, part++, bytes, now);
        bytes += now;
        count -= now;
        if (now == LINK_PAYLOAD && count == 0) send_part(kind, part++, bytes, 0); // a short part is the last one
    } while (count > 0);
}
