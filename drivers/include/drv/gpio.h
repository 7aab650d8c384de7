// SPDX-License-Identifier: MIT
/// @file gpio.h
/// One GPIO line: an input whose edges come with time stamps, or an output.
///
/// The same on libgpiod 1.6 and 2.x; the build takes the one that is installed. open may allocate (libgpiod does);
/// nothing after it does until close. One thread uses a line. After an error `error` holds one sentence that names chip
/// and line and says what was found; the value returned is -errno.
///
/// The kernel stamps an edge by CLOCK_MONOTONIC in its interrupt. It is carried to host time (host_clock.h), the
/// time of CAN stamps, by reading both clocks when the edge is read; `clock_error_ns` bounds the error of that pairing.
#ifndef DRV_GPIO_H
#define DRV_GPIO_H

#include <drv/source.h>

#ifdef __cplusplus
extern "C" {
#endif

/// Longest name of a chip or line, with its closing 0.
enum { DRV_GPIO_NAME_BYTES = 64 };

/// Which edges are wanted, or which one came.
typedef enum drv_gpio_edge_t {
    DRV_GPIO_NO_EDGE = 0, ///< an input that is only looked at
    DRV_GPIO_RISING = 1,  ///< to active
    DRV_GPIO_FALLING = 2, ///< to inactive
    DRV_GPIO_BOTH = 3     ///< either
} drv_gpio_edge_t;

/// What holds an open input.
typedef enum drv_gpio_bias_t {
    DRV_GPIO_BIAS_AS_IS,    ///< as it is
    DRV_GPIO_BIAS_OFF,      ///< nothing
    DRV_GPIO_BIAS_PULL_UP,  ///< a resistor to the supply
    DRV_GPIO_BIAS_PULL_DOWN ///< a resistor to ground
} drv_gpio_bias_t;

/// Which line, and as what.
typedef struct drv_gpio_config_t {
    const char* chip;     ///< "gpiochip0", "/dev/gpiochip0" or the chip's label
    const char* line;     ///< name of the line, NULL = `offset` says which
    int32_t offset;       ///< number of the line on its chip
    int32_t active_low;   ///< 1 = a low voltage is active (1)
    int32_t initial;      ///< output: 0 or 1 from the start on
    drv_gpio_edge_t edge; ///< input
    drv_gpio_bias_t bias; ///< input
    uint32_t debounce_us; ///< input, 0 = none; libgpiod 2 only, -EOPNOTSUPP with 1.6
} drv_gpio_config_t;

/// An edge.
typedef struct drv_gpio_event_t {
    int64_t time_ns;      ///< host time
    int64_t monotonic_ns; ///< CLOCK_MONOTONIC, as the kernel stamped it
    drv_gpio_edge_t edge; ///< DRV_GPIO_RISING or DRV_GPIO_FALLING
    uint32_t lost;        ///< edges known to have been lost just before this one
} drv_gpio_event_t;

/// A line that is open, or was.
typedef struct drv_gpio_t {
    /// @cond private
    void* chip; ///< of libgpiod, between open and close, as the next two
    void* line;
    void* buffer;
    int32_t offset, line_count;
    int32_t expected; ///< whose edge or number comes next, for finding losses
    /// @endcond
    uint64_t events; ///< edges read
    /// Edges the kernel dropped because they were not read in time. libgpiod 2: exact, by the kernel's numbers. 1.6 has
    /// no numbers: with both edges two alike in a row count one, a single edge shows no loss.
    uint64_t lost;
    int64_t clock_error_ns;              ///< bound of the pairing of the two clocks at the last read
    char chip_name[DRV_GPIO_NAME_BYTES]; ///< as the kernel has it
    char line_name[DRV_GPIO_NAME_BYTES]; ///< name, or number
    char error[DRV_ERROR_BYTES];         ///< one sentence, "" = none
} drv_gpio_t;

/// Take a line as an input. Errors: -ENOENT no such chip or line, -EACCES, -EBUSY in use, -EINVAL, -ENODEV the chip cannot tell
/// edges, -EOPNOTSUPP debounce, -ENOTTY no GPIO chip, -ENOSYS built without libgpiod.
int drv_gpio_open_input(drv_gpio_t* self, const drv_gpio_config_t* config);
/// Take a line as an output; errors as above.
int drv_gpio_open_output(drv_gpio_t* self, const drv_gpio_config_t* config);

/// To poll for reading edges; -1 unless the line is an open input with edges.
int drv_gpio_fd(const drv_gpio_t* self);
/// Edges that wait. @return how many, 0 = none now, -errno
int drv_gpio_read(drv_gpio_t* self, drv_gpio_event_t* events, int capacity);
/// Level now, input or output. @return 1 active, 0 inactive, -errno
int drv_gpio_get(drv_gpio_t* self);
/// Set an output. @return 0 or -errno
int drv_gpio_set(drv_gpio_t* self, int active);
/// Safe after a failed open. The line goes back to the kernel.
void drv_gpio_close(drv_gpio_t* self);

/// The GPIO chips of this machine as "gpiochip0 (label, 8 lines), …"; "" when there is none. @return how many
int drv_gpio_list_chips(char* text, size_t bytes);

#ifdef __cplusplus
}
#endif
#endif
