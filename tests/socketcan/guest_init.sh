#!/bin/sh
# Process 1 of the user-mode-linux guest: CAN modules, vcan0, a RAM disk, then job.sh of the folder that the
# kernel's command line names. That folder and the repository's (numba's cache) can be written to.
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t tmpfs tmpfs /run
mount -t tmpfs -o size=4G tmpfs /tmp
argument() { sed -n "s/.*$1=\([^ ]*\).*/\1/p" /proc/cmdline; }
folder=$(argument FOLDER)
for writable in "$folder" "$(argument REPOSITORY)"; do
    mkdir -p "$writable" && mount -t hostfs -o "$writable" none "$writable"
done
grep -q ' /dev devtmpfs' /proc/mounts || mount -t devtmpfs dev /dev
mkdir -p /dev/pts /dev/shm
mount -t devpts -o ptmxmode=666 devpts /dev/pts
mount -t tmpfs shm /dev/shm
modules=/usr/lib/uml/modules/$(uname -r)/kernel
for module in net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/vcan \
    drivers/net/can/slcan/slcan net/sched/sch_plug drivers/md/dm-mod; do
    busybox insmod "$modules/$module.ko" || echo "insmod $module failed"
done
busybox insmod "$modules/drivers/block/brd.ko" rd_nr=1 rd_size=1048576 || echo "insmod brd failed"
ip link set lo up
ip link add dev vcan0 type vcan && ip link set vcan0 txqueuelen 10 up
sh "$folder/job.sh"
echo "GUEST-JOB-ENDED $?"
busybox poweroff -f
