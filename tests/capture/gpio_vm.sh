#!/bin/sh
# Boots a virtual machine with a simulated GPIO chip (the kernel's gpio-sim, built here from Debian's kernel source,
# because Debian's kernel lacks it) and runs gpio_guest_test in it. Exit status 77: a package is missing.
#   gpio_vm.sh GUEST_TEST
set -eu
guest_test=$(readlink -f "$1")

skip() { echo "skipped: $*: apt-get install qemu-system-x86 linux-image-amd64 linux-headers-amd64 linux-source-6.1 busybox-static cpio"; exit 77; }
[ "$(uname -m)" = x86_64 ] || { echo "skipped: needs an x86_64 machine"; exit 77; }
for program in qemu-system-x86_64 cpio make gcc; do command -v $program >/dev/null || skip "no $program"; done
busybox=$(command -v busybox) || skip "no busybox"
source=/usr/src/linux-source-6.1.tar.xz
[ -r $source ] || skip "no $source"
kernel=""
for image in /boot/vmlinuz-6.1.*-amd64; do
  version=${image#/boot/vmlinuz-}
  [ -r "$image" ] && [ -d "/usr/src/linux-headers-$version" ] && [ -d "/lib/modules/$version" ] && kernel=$version
done
[ -n "$kernel" ] || skip "no kernel 6.1 with its headers"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT INT TERM

# The module: gpio-sim with the simulated interrupts it needs, which Debian leaves out as well.
mkdir "$work/module"
tar xf $source -C "$work/module" --strip-components=1 --wildcards '*/drivers/gpio/gpio-sim.c' '*/drivers/gpio/gpiolib.h' '*/kernel/irq/irq_sim.c'
cd "$work/module"
mv drivers/gpio/gpio-sim.c drivers/gpio/gpiolib.h kernel/irq/irq_sim.c .
# irq_to_desc is not exported to modules; this is what it does.
sed -i 's/irq_to_desc(irqnum)/irq_data_to_desc(irq_get_irq_data(irqnum))/' irq_sim.c
printf 'obj-m := gpio_sim.o\ngpio_sim-y := gpio-sim.o irq_sim.o\n' > Kbuild
make -s -C "/usr/src/linux-headers-$kernel" M="$PWD" modules

# The machine's file system: busybox, the modules, the test and its libraries.
root=$work/root
mkdir -p "$root/bin" "$root/proc" "$root/sys" "$root/dev" "$root/tmp" "$root/lib64"
cp "$busybox" "$root/bin/busybox"
cp gpio_sim.ko "$root/"
xz=$(find "/lib/modules/$kernel/kernel/fs/configfs" -name 'configfs.ko*' | head -1)
case "$xz" in
  *.xz) xz -dc "$xz" > "$root/configfs.ko" ;;
  *) cp "$xz" "$root/configfs.ko" ;;
esac
cp "$guest_test" "$root/guest_test"
for library in $(ldd "$guest_test" | awk '$2 == "=>" { print $3 } $1 ~ /^\// { print $1 }'); do
  mkdir -p "$root$(dirname "$library")"
  cp -L "$library" "$root$library"
done
cat > "$root/init" <<'INIT'
#!/bin/busybox sh
/bin/busybox --install -s /bin
export PATH=/bin
mount -t proc none /proc
mount -t sysfs none /sys
mount -t devtmpfs none /dev
insmod /configfs.ko
mount -t configfs none /sys/kernel/config
insmod /gpio_sim.ko
bank=/sys/kernel/config/gpio-sim/sole/bank
mkdir /sys/kernel/config/gpio-sim/sole $bank
echo 4 > $bank/num_lines
n=0
for name in trigger speckle texture exposure; do
  mkdir $bank/line$n
  echo $name > $bank/line$n/name
  n=$((n + 1))
done
echo 1 > /sys/kernel/config/gpio-sim/sole/live
export SOLE_GPIO_CHIP=$(cat $bank/chip_name)
export SOLE_GPIO_SYSFS=/sys/devices/platform/$(cat /sys/kernel/config/gpio-sim/sole/dev_name)/$SOLE_GPIO_CHIP
/guest_test
echo "guest test status $?"
poweroff -f
INIT
chmod +x "$root/init"
(cd "$root" && find . | cpio -o -H newc --quiet | gzip -1) > "$work/initramfs.gz"

timeout 240 qemu-system-x86_64 -accel tcg -smp 2 -m 1024 -nographic -no-reboot -nodefaults -serial stdio -net none \
  -kernel "/boot/vmlinuz-$kernel" -initrd "$work/initramfs.gz" -append "console=ttyS0 quiet panic=-1" < /dev/null |
  tr -d '\r' | tee "$work/console"
grep -q '^guest test status 0$' "$work/console"
