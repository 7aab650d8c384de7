#!/bin/bash
# SPDX-License-Identifier: MIT
# PID 1 of a test kernel; the root is the host's own, so nothing is touched before /dev is private. On the stock kernel
# (OKID_STOCK) the root is read only and first.sh has mounted it; there temporary files go to memory.
# Run by boot; $OKID_ROOM (from the kernel's command line) holds the command, its folder and its environment.
PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
power_off() {
  sync
  echo o >/proc/sysrq-trigger
  while :; do sleep 1; done
}
[ -n "${OKID_STOCK:-}" ] || mount -t proc proc /proc || exit 1
grep -q '^[^ ]* /dev devtmpfs ' /proc/mounts || mount -t devtmpfs dev /dev || power_off # never the host's /dev
[ -n "${OKID_STOCK:-}" ] || mount -t sysfs sys /sys
mkdir -p /dev/pts /dev/shm
mount -t devpts pts /dev/pts
mount -t tmpfs shm /dev/shm
mount -t tmpfs run /run
mount -t configfs config /sys/kernel/config 2>/dev/null
ln -sf /proc/self/fd /dev/fd
ip link set lo up multicast on
ip route add 224.0.0.0/4 dev lo
ip route add 192.0.2.0/24 dev lo # addresses beyond this computer, for datagrams that nobody hears
# One slow processor for senders and receivers: what vcan hands on must not be dropped before a socket sees it.
echo 100000 >/proc/sys/net/core/netdev_max_backlog

if [ -n "${OKID_STOCK:-}" ]; then
  modprobe -d "$OKID_STOCK" -a can_raw kvaser_pci || power_off
else
  # Nothing in this machine makes randomness: the host gives the first of it (RNDADDENTROPY), or who asks waits for ever.
  python3 -c 'import fcntl, struct, sys
seed = open(sys.argv[1], "rb").read()
fcntl.ioctl(open("/dev/random", "wb"), 0x40085203, struct.pack("ii", 8 * len(seed), len(seed)) + seed)' "$OKID_ROOM/seed"
  ip link add vcan0 type vcan && ip link set vcan0 mtu 72 && ip link set vcan0 up || power_off
fi

room=$OKID_ROOM
(
  . "$room/environment"
  [ -z "$OKID_STOCK" ] || export TMPDIR=/dev/shm OKID_STOCK
  cd "$(cat "$room/folder")" || exit 90
  eval "$(cat "$room/command")"
) </dev/null >"$room/out" 2>"$room/err"
echo $? >"$room/rc.part"
mv "$room/rc.part" "$room/rc"
power_off
