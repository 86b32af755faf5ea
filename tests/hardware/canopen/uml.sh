#!/usr/bin/env bash
# uml.sh <program> <arguments>...: runs the program inside User Mode Linux, with a virtual CAN line
# that is called vcan0. The files are those of the host. ICAT_* of the environment go with it, and
# ICAT_CAN_INTERFACE is vcan0. The last line says how the program ended:
#
#     uml: exit status <n>
#
# On a processor whose registers its kernel cannot save (AMX), it says so and ends with 77.
#
# Debian: user-mode-linux, kmod, iproute2. Nothing here needs root.
set -euo pipefail
(($#)) || { echo "usage: uml.sh <program> <arguments>..." >&2; exit 2; }
for tool in linux.uml insmod ip; do
  PATH=$PATH:/usr/sbin:/sbin command -v "$tool" >/dev/null || { echo "uml.sh: no $tool" >&2; exit 2; }
done
drivers=$(find /usr/lib/uml/modules -path '*/kernel/net/can/can.ko' | head -n1)
[[ -n $drivers ]] || { echo "uml.sh: no module can.ko in /usr/lib/uml/modules" >&2; exit 2; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
{
  cat <<INIT
#!/bin/bash
# The first process inside.
export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/tmp TERM=dumb ICAT_CAN_INTERFACE=vcan0
mount -t proc proc /proc
mount -t sysfs sys /sys
for module in net/can/can net/can/can-raw drivers/net/can/dev/can-dev drivers/net/can/vcan net/can/can-bcm; do
  insmod ${drivers%/net/can/can.ko}/\$module.ko || echo "uml: no module \$module"
done
ip link set lo up
ip link add dev vcan0 type vcan && ip link set vcan0 up || echo "uml: no vcan0"
cd $(printf %q "$PWD")
INIT
  for name in "${!ICAT_@}"; do
    [[ $name == ICAT_CAN_INTERFACE ]] || printf 'export %s=%q\n' "$name" "${!name}"
  done
  printf '%q ' "$@"
  cat <<'INIT'
</dev/null
echo "uml: exit status $?"
echo o >/proc/sysrq-trigger
sleep 60
INIT
} >"$work/init"
chmod +x "$work/init"

export TMPDIR=$work
timeout -k 5 "${ICAT_UML_SECONDS:-240}" linux.uml mem=256M uml_dir="$work" rootfstype=hostfs \
  rootflags=/ rw init="$work/init" con=null con0=null,fd:1 quiet </dev/null 2>"$work/errors" |
  tr -d '\r' | tee "$work/output" || true
if cat "$work/errors" "$work/output" | grep -q 'ptrace set fp regs failed'; then
  echo "uml: not run: the kernel of User Mode Linux cannot save the registers of this processor"
  exit 77
fi
grep -q '^uml: exit status 0$' "$work/output" || { cat "$work/errors" >&2; exit 1; }
