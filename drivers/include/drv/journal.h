// SPDX-License-Identifier: MIT
/// @file journal.h
/// A journal of frames (.okj): an append-only file of chunks that can be cut anywhere and still be read. The bytes are
/// in docs/reference/journal-format.md. Writer and reader have fixed buffers, no heap, no clock and no file of their own: bytes
/// go out and come in through functions, so that a test can cut the power after every one of them.
#ifndef DRV_JOURNAL_H
#define DRV_JOURNAL_H

#include <drv/frame.h>
#include <drv/source.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Of the format.
enum {
    DRV_JOURNAL_VERSION = 1,       ///< of what is written
    DRV_JOURNAL_MAGIC = 8,         ///< bytes that begin every chunk
    DRV_JOURNAL_HEADER = 64,       ///< bytes before the payload of a chunk
    DRV_JOURNAL_PAYLOAD = 1 << 16, ///< most bytes behind them
    DRV_JOURNAL_NAME_BYTES = 4096, ///< longest name of a text
    DRV_JOURNAL_FRAME_BYTES = 88   ///< most bytes of one frame
};

/// What a chunk holds.
typedef enum drv_journal_kind_t {
    DRV_JOURNAL_OTHER = 0,  ///< of a later version, to be ignored
    DRV_JOURNAL_TEXT = 1,   ///< a piece of a named text: what the frames mean
    DRV_JOURNAL_FRAMES = 2, ///< frames as they came
    DRV_JOURNAL_END = 3     ///< the file was closed properly
} drv_journal_kind_t;

/// Both clocks of the host, read when a chunk is written.
typedef struct drv_journal_time_t {
    int64_t real_ns;      ///< CLOCK_REALTIME
    int64_t monotonic_ns; ///< CLOCK_MONOTONIC
} drv_journal_time_t;

/// Where the bytes go.
typedef struct drv_journal_sink_t {
    /// Append. @return bytes written, fewer than `count` when no more fit, or -errno. -EINTR is tried again.
    long (*write)(void* context, const uint8_t* bytes, size_t count);
    /// Cut the file off at `size`, after a write that did not get through. @return 0 or -errno
    int (*truncate)(void* context, uint64_t size);
    void* context; ///< handed to both
} drv_journal_sink_t;

/// A journal that is written.
typedef struct drv_journal_writer_t {
    drv_journal_sink_t sink; ///< where the bytes go
    uint64_t run;            ///< random: tells the chunks of one run from what else may stand on a disk
    uint32_t sequence;       ///< of the next chunk; goes on through all segments of a run
    uint64_t bytes;          ///< of the file so far, whole chunks only
    uint64_t chunks;         ///< written since begin
    int error;               ///< 0, or the -errno that ended it
    /// @cond private
    uint64_t lost;
    uint32_t frames;
    size_t used;
    uint8_t buffer[DRV_JOURNAL_HEADER + DRV_JOURNAL_PAYLOAD];
    /// @endcond
} drv_journal_writer_t;

/// A new file, the next segment of the run; only while no frame waits. What was lost meanwhile is kept for its first
/// frames.
/// @param self  zeroed once, before the first segment
void drv_journal_begin(drv_journal_writer_t* self, const drv_journal_sink_t* sink, uint64_t run);

/// Write a text, in as many chunks as it takes; only while no frame waits. @return 0 or -errno; -EINVAL for a name that
/// is empty or too long
int drv_journal_text(drv_journal_writer_t* self, const char* name, const char* text, size_t bytes,
                     const drv_journal_time_t* now);

/// Add a frame to the chunk at hand; nothing is written.
/// @return 1 when it is in, 0 when the chunk is full (flush first), -EINVAL for a length no frame has
int drv_journal_add(drv_journal_writer_t* self, const drv_frame_t* frame);
/// So many frames were lost before the next one; only while no frame waits.
void drv_journal_lost(drv_journal_writer_t* self, uint64_t count);
/// Frames that wait for the next flush.
uint32_t drv_journal_waiting(const drv_journal_writer_t* self);
/// Write the chunk at hand, in one call of write() when all goes well; nothing when it is empty. On an error the file
/// is cut back to its last whole chunk, and every later call gives the same error. @return 0 or -errno
int drv_journal_flush(drv_journal_writer_t* self, const drv_journal_time_t* now);
/// Flush and close the file properly. @param more  the run goes on in the next segment
int drv_journal_end(drv_journal_writer_t* self, int more, const drv_journal_time_t* now);

/// Do these DRV_JOURNAL_MAGIC bytes begin a journal?
int drv_journal_magic(const uint8_t* bytes);

/// Where bytes come from. @return bytes read, 0 at the end, -errno
typedef long (*drv_journal_read_t)(void* context, uint8_t* bytes, size_t count);

/// A whole and valid chunk.
typedef struct drv_journal_chunk_t {
    drv_journal_kind_t kind; ///< checked: a byte that is none of them is DRV_JOURNAL_OTHER
    uint32_t sequence;       ///< number of the chunk in the run
    uint32_t frames;         ///< in the payload
    uint64_t run;            ///< which run it belongs to
    drv_journal_time_t time; ///< when it was written
    uint64_t lost;           ///< frames the recorder itself lost just before this chunk
    int gap;                 ///< 1 = chunks or bytes that should stand before this one are missing
    int more;                ///< DRV_JOURNAL_END: the run goes on in the next segment
    const uint8_t* payload;  ///< what it holds
    size_t bytes;            ///< of the payload
} drv_journal_chunk_t;

/// A journal that is read.
typedef struct drv_journal_reader_t {
    uint64_t run;           ///< of the first valid chunk
    uint64_t chunks;        ///< valid ones given
    uint64_t missing;       ///< chunks that are not there, by the numbers of those around them
    uint64_t damaged;       ///< places where bytes made no valid chunk
    uint64_t skipped_bytes; ///< at them
    uint64_t torn_bytes;    ///< at the end of the file, of a chunk that was not written to its end
    uint64_t foreign;       ///< valid chunks of another run, or older than those before them: left out
    unsigned newer;         ///< version of chunks that a later okid wrote, 0 = none
    int ended;              ///< the last chunk says that the file was closed properly
    int more;               ///< and that the run goes on in another file
    /// @cond private
    drv_journal_read_t read;
    void* context;
    int started, at_end, broken;
    uint32_t expected;
    size_t begin, end;
    uint64_t lost_sync;
    uint8_t buffer[2 * (DRV_JOURNAL_HEADER + DRV_JOURNAL_PAYLOAD)];
    /// @endcond
} drv_journal_reader_t;

/// Begin with a file.
void drv_journal_reader_begin(drv_journal_reader_t* self, drv_journal_read_t read, void* context);
/// The same run goes on in another file.
void drv_journal_reader_continue(drv_journal_reader_t* self, drv_journal_read_t read, void* context);
/// The next valid chunk, whatever lies in between. Its payload stays until the next call.
/// @return 1, 0 at the end, or -errno of the read
int drv_journal_next(drv_journal_reader_t* self, drv_journal_chunk_t* chunk);

/// The next frame of a DRV_JOURNAL_FRAMES chunk. @param at  0 for the first one, then as it was left
/// @return 1, 0 when there are no more
int drv_journal_frame(const drv_journal_chunk_t* chunk, size_t* at, drv_frame_t* frame);

/// A piece of a text; points into the payload, nothing is terminated by 0.
typedef struct drv_journal_text_t {
    const char* name;   ///< of the text
    const char* piece;  ///< a piece of it
    size_t name_bytes;  ///< characters of the name
    size_t piece_bytes; ///< characters of the piece
    uint64_t offset;    ///< where in the text the piece stands
    uint64_t total;     ///< how long the text is
} drv_journal_text_t;

/// Take a DRV_JOURNAL_TEXT chunk apart. @return 1, or 0 when its payload is none
int drv_journal_text_of(const drv_journal_chunk_t* chunk, drv_journal_text_t* out);

/// Name of the segment behind `path`: NAME-0001.okj -> NAME-0002.okj. @return 1, 0 when the name has no number or `out`
/// no room
int drv_journal_next_name(const char* path, char* out, size_t capacity);

/// What an open drv_source_journal has found so far.
const drv_journal_reader_t* drv_source_journal_reader(const drv_source_t* source);
/// Segments it has read, the one at hand included.
int drv_source_journal_segments(const drv_source_t* source);

#ifdef __cplusplus
}
#endif
#endif
