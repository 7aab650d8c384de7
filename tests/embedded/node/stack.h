// SPDX-License-Identifier: MIT
/// @file stack.h
/// How deep the stack has been since reset.
#ifndef NODE_STACK_H
#define NODE_STACK_H

#include <stddef.h>
#include <stdint.h>

/// Bytes used at the deepest moment. Equal to stack_room(): it may have been more.
uint32_t stack_used(void);

/// Bytes set aside by the linker script.
uint32_t stack_room(void);

#endif
