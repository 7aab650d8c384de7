// SPDX-License-Identifier: MIT
/// @file decoder.h
/// Bytes off a serial line to numbers. A scanner looks at the bytes at hand and says what stands at their beginning; it
/// has no state. A decoder holds the bytes, asks the scanner of its framing, and counts what made no packet.
#ifndef DRV_DECODER_H
#define DRV_DECODER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Most numbers of a packet; bytes a decoder holds.
enum { DRV_PACKET_VALUES = 504, DRV_DECODER_BYTES = 4096 };

/// What stands on a line.
typedef enum drv_framing_t {
    DRV_FRAMING_COBS,      ///< the project's own packets, stream.h
    DRV_FRAMING_ASCII,     ///< lines of numbers
    DRV_FRAMING_WITMOTION, ///< 0x55 packets of 11 bytes: field 0-2 acceleration [g], 3-5 rate [deg/s], 6-8 angle [deg]
    DRV_FRAMING_VECTORNAV, ///< 0xFA binary output: field 0-2 acceleration [m/s^2], 3-5 rate [rad/s]
    DRV_FRAMINGS           ///< how many there are
} drv_framing_t;

/// What one packet holds: `samples` rows of `fields` numbers, NaN where a field is empty.
typedef struct drv_packet_t {
    uint8_t counted;                  ///< `sequence` is there
    uint8_t timed;                    ///< `time_ns` is there
    uint32_t sequence;                ///< number of the first sample
    uint64_t time_ns;                 ///< the device's clock at the first sample
    unsigned time_bits;               ///< after so many bits of microseconds the clock wraps; 64 = never
    uint16_t first_field;             ///< of the row; the packet of a kind always begins with the same one
    uint16_t fields;                  ///< numbers of a row
    uint16_t samples;                 ///< rows
    double values[DRV_PACKET_VALUES]; ///< row by row
} drv_packet_t;

/// What a scanner found at the beginning of its bytes.
typedef enum drv_scan_t {
    DRV_SCAN_MORE,    ///< not enough bytes to tell
    DRV_SCAN_IDLE,    ///< valid, but holds no samples
    DRV_SCAN_NOISE,   ///< begins no packet
    DRV_SCAN_DAMAGED, ///< a packet whose check sum or form is wrong
    DRV_SCAN_PACKET   ///< a packet with samples
} drv_scan_t;

/// The project's own packets. @param used  out: bytes to drop before the next scan; 0 only with DRV_SCAN_MORE
drv_scan_t drv_scan_cobs(const uint8_t* bytes, size_t count, drv_packet_t* packet, size_t* used);
/// Lines of numbers; parameters as above.
drv_scan_t drv_scan_ascii(const uint8_t* bytes, size_t count, drv_packet_t* packet, size_t* used);
/// Packets of WitMotion; parameters as above.
drv_scan_t drv_scan_witmotion(const uint8_t* bytes, size_t count, drv_packet_t* packet, size_t* used);
/// Packets of VectorNav; parameters as above.
drv_scan_t drv_scan_vectornav(const uint8_t* bytes, size_t count, drv_packet_t* packet, size_t* used);

/// Bytes at hand, and what was made of those before.
typedef struct drv_decoder_t {
    drv_framing_t framing;            ///< what stands on the line
    int32_t counter;                  ///< ASCII: 1 + the field that counts samples, 0 = none
    int synced;                       ///< a packet was found: from now on what makes none is counted
    int broken;                       ///< something was refused since the packet before
    int in_line;                      ///< ASCII: the line at hand began before we did
    unsigned width;                   ///< ASCII: numbers a line has
    unsigned other;                   ///< ASCII: lines in a row that had another count
    uint64_t damaged;                 ///< packets or lines refused
    uint64_t skipped;                 ///< bytes that belonged to nothing
    size_t begin;                     ///< of the unread part of `bytes`
    size_t end;                       ///< of the unread part
    uint8_t bytes[DRV_DECODER_BYTES]; ///< at hand
    drv_packet_t packet;              ///< the newest one
} drv_decoder_t;

/// Begin. @param counter  ASCII: 1 + the field that counts samples, 0 = none
void drv_decoder_init(drv_decoder_t* self, drv_framing_t framing, int32_t counter);

/// The stream was interrupted: forget the bytes at hand; the counts stay.
void drv_decoder_restart(drv_decoder_t* self);

/// Room for more bytes: write up to the returned count at *at, then call drv_decoder_add(). Never 0 once
/// drv_decoder_next() has returned 0.
size_t drv_decoder_room(drv_decoder_t* self, uint8_t** at);
/// So many bytes were written where drv_decoder_room() said.
void drv_decoder_add(drv_decoder_t* self, size_t count);

/// The next packet into self->packet. @return 1; 2 when something was refused just before it; 0 = more bytes are needed
int drv_decoder_next(drv_decoder_t* self);

/// What is known of a framing.
typedef struct drv_framing_info_t {
    const char* name; ///< in a CONFIG.toml
    /// Its scanner.
    drv_scan_t (*scan)(const uint8_t* bytes, size_t count, drv_packet_t* packet, size_t* used);
    unsigned fields; ///< consecutive ones that arrive together, at most 7: the frames of line_frame.h hold so many
    unsigned limit;  ///< fields it can deliver
    unsigned counter_bits; ///< of the number that its packets give to samples; 0 = none
    const char* unit;      ///< of fields 0 to 2, "" = whatever the sender measures
} drv_framing_info_t;

/// Of every framing, in the order of drv_framing_t; a new one is a line here.
extern const drv_framing_info_t drv_framings[DRV_FRAMINGS];

#ifdef __cplusplus
}
#endif
#endif
