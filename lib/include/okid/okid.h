// SPDX-License-Identifier: MIT
/// @file okid.h
/// All of the library.
#ifndef OKID_H
#define OKID_H
#include <okid/accumulator.h>
#include <okid/identify.h>
#include <okid/mechanics.h>
#include <okid/mkr.h>
#include <okid/modal.h>
#include <okid/model.h>
#include <okid/refine.h>
#include <okid/stabilization.h>
#include <okid/track.h>
#include <okid/types.h>
#include <okid/uncertainty.h>
#include <okid/watch.h>
#endif
