// SPDX-License-Identifier: MIT
// PURPOSE  from reset to main() on a Cortex-M with a floating-point unit: vectors, memory, painted stack
// METHOD   the stack stands below all data (node.ld), so that one too deep leaves the RAM and faults; what it has used is
//          seen by what is left of the paint
#include "stack.h"

#include <string.h>

extern uint32_t node_stack_bottom[], node_stack_top[], node_data_load[], node_data[], node_data_end[], node_bss[],
    node_bss_end[];
int main(void);
void reset(void);
void stop(void);

#define CPACR (*(volatile uint32_t*)0xE000ED88)
enum { PAINT = 0x5AA5C33C, SPARE = 16 };

void stop(void) {
    for (;;) {
    }
}

/// The first two words are the stack and the program; then the system exceptions. No interrupt is used.
__attribute__((section(".vectors"), used)) static const void* const vectors[16] = {
    node_stack_top, (void*)reset, (void*)stop, (void*)stop, (void*)stop, (void*)stop, (void*)stop, 0, 0, 0, 0,
    (void*)stop,    (void*)stop,  0,           (void*)stop, (void*)stop};

static void paint(void) {
    const uint32_t* here = (const uint32_t*)__builtin_frame_address(0) - SPARE;
    for (volatile uint32_t* at = node_stack_bottom; at < here; ++at) *at = PAINT;
}

static size_t span(const uint32_t* from, const uint32_t* to) { return (size_t)((const char*)to - (const char*)from); }

void reset(void) {
    CPACR |= 0xFu << 20; // the floating-point unit, before anything may push its registers
    __asm volatile("dsb\n isb" ::: "memory");
    memcpy(node_data, node_data_load, span(node_data, node_data_end));
    memset(node_bss, 0, span(node_bss, node_bss_end));
    paint();
    main();
    stop();
}

uint32_t stack_used(void) {
    const uint32_t* at = node_stack_bottom;
    while (at < node_stack_top && *at == PAINT) ++at;
    return (uint32_t)span(at, node_stack_top);
}

uint32_t stack_room(void) { return (uint32_t)span(node_stack_bottom, node_stack_top); }
