#!/usr/bin/env bash
# Says the newest glibc that a binary asks for, and fails if that is newer than MOST.
#   scripts/glibc-needed.sh BINARY [MOST]
set -euo pipefail

needed=$(objdump -T "$1" | grep -o 'GLIBC_[0-9.]*' | sort -uV | tail -n 1)
echo "$1 needs ${needed:-no glibc}"
if [ $# -gt 1 ] && [ "$(printf 'GLIBC_%s\n%s\n' "$2" "$needed" | sort -V | tail -n 1)" != "GLIBC_$2" ]; then
    echo "failed: newer than $2:"
    objdump -T "$1" | grep -F "$needed"
    exit 1
fi
