#!/bin/bash
# SPDX-License-Identifier: MIT
# PID 1 inside User-Mode Linux; the root is the host's own, so nothing is touched before /dev is private.
# Run by boot; $OKID_ROOM (from the kernel's command line) holds the command, its folder and its environment.
PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
power_off() {
  sync
  echo o >/proc/sysrq-trigger
  while :; do sleep 1; done
}
mount -t proc proc /proc || exit 1
grep -q '^[^ ]* /dev devtmpfs ' /proc/mounts || mount -t devtmpfs dev /dev || power_off # never the host's /dev
mount -t sysfs sys /sys
mkdir -p /dev/pts /dev/shm
mount -t devpts pts /dev/pts
mount -t tmpfs shm /dev/shm
mount -t tmpfs run /run
mount -t configfs config /sys/kernel/config 2>/dev/null
ln -sf /proc/self/fd /dev/fd
ip link set lo up
# One slow processor for senders and receivers: what vcan hands on must not be dropped before a socket sees it.
echo 100000 >/proc/sys/net/core/netdev_max_backlog

# Nothing in this machine makes randomness: the host gives the first of it (RNDADDENTROPY), or who asks for some waits for ever.
python3 -c 'import fcntl, struct, sys
seed = open(sys.argv[1], "rb").read()
fcntl.ioctl(open("/dev/random", "wb"), 0x40085203, struct.pack("ii", 8 * len(seed), len(seed)) + seed)' "$OKID_ROOM/seed"

ip link add vcan0 type vcan && ip link set vcan0 mtu 72 && ip link set vcan0 up || power_off

room=$OKID_ROOM
(
  . "$room/environment"
  cd "$(cat "$room/folder")" || exit 90
  eval "$(cat "$room/command")"
) </dev/null >"$room/out" 2>"$room/err"
echo $? >"$room/rc.part"
mv "$room/rc.part" "$room/rc"
power_off
