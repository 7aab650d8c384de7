// SPDX-License-Identifier: MIT
// PURPOSE    names for sources that are compiled once for each instruction set (lib/CMakeLists.txt defines OKID_KERNEL_ISA;
//            the plain build is `base` and also holds the choice at run time)
#ifndef OKID_ISA_H
#define OKID_ISA_H

#ifndef OKID_KERNEL_ISA
#define OKID_KERNEL_ISA base
#define OKID_KERNEL_IS_BASE 1
#endif
#define OKID_JOIN_(a, b) a##b
#define OKID_JOIN(a, b) OKID_JOIN_(a, b)
#define OKID_FOR_ISA(name) OKID_JOIN(name, OKID_KERNEL_ISA)

#endif
