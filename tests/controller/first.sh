#!/bin/busybox sh
# SPDX-License-Identifier: MIT
# The first program of the emulated machine: the host's files become its root, read only; then tests/kernel/init.sh.
b=/bin/busybox
$b mount -t devtmpfs dev /dev
$b mount -t proc proc /proc
$b mount -t sysfs sys /sys
while read -r file; do $b insmod "/modules/$file"; done </modules/order
share=trans=virtio,version=9p2000.L,msize=524288
$b mount -t 9p -o "ro,$share,cache=loose" root /host || $b poweroff -f
$b mount -t 9p -o "$share,cache=none" room "/host$OKID_ROOM" || $b poweroff -f
for folder in dev proc sys; do $b mount --move /$folder /host/$folder; done
exec $b switch_root /host "$OKID_INIT"
