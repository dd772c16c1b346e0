#!/usr/bin/env bash
# Runs all tests. Those of the GPU path need a Vulkan adapter; where none answers, Mesa's software
# adapter is set up first. Without one they are skipped aloud, or, with CI=true or
# NNGTL_REQUIRE_GPU_TESTS=1 in the environment, the run fails.
set -euo pipefail
cd "$(dirname "$0")"

# Where the driver is unpacked if it cannot be installed.
readonly unpacked="$PWD/target/vulkan"
readonly packages=(mesa-vulkan-drivers libvulkan1)

# Mesa complains on each start where sessions have no folder of their own, as in containers.
if [[ -z "${XDG_RUNTIME_DIR:-}" ]]; then
    export XDG_RUNTIME_DIR="$PWD/target/run"
    mkdir -p -m 700 "$XDG_RUNTIME_DIR"
fi

say() {
    printf 'test.sh: %s\n' "$*" >&2
}

required() {
    [[ "${NNGTL_REQUIRE_GPU_TESTS:-}" == 1 || "${CI:-}" == true || "${CI:-}" == 1 ]]
}

# Whether the program finds an adapter of any kind.
adapter_answers() {
    local list
    list=$(cargo run --locked --quiet -- --json devices 2>/dev/null) || return 1
    [[ "$list" == *'"adapters":[{'* ]]
}

# apt_get ARGUMENTS...: never asks, as root or with a sudo that asks no password.
apt_get() {
    if [[ "$(id -u)" == 0 ]]; then
        DEBIAN_FRONTEND=noninteractive apt-get "$@"
    else
        sudo -n env DEBIAN_FRONTEND=noninteractive apt-get "$@"
    fi
}

may_install() {
    [[ "$(id -u)" == 0 ]] || { command -v sudo && sudo -n true; } >/dev/null 2>&1
}

install_adapter() {
    say "installing ${packages[*]}"
    # A list that cannot be fetched is no reason to give up: another may hold the packages.
    apt_get update -qq || say "apt-get update failed, going on with the lists that are there"
    apt_get install -y -qq --no-install-recommends "${packages[@]}"
}

# Without the right to install: the packages and what they depend on, unpacked below target/.
unpack_adapter() {
    say "unpacking ${packages[*]} below target/vulkan (no right to install them)"
    mkdir -p "$unpacked"/{root,debs,lists/partial,cache/archives/partial}
    local apt=(apt-get -qq -o "Dir::State::Lists=$unpacked/lists" -o "Dir::Cache=$unpacked/cache"
        -o Debug::NoLocking=1)
    "${apt[@]}" update || return 1
    local wanted
    wanted=$("${apt[@]}" -s --no-install-recommends install "${packages[@]}" |
        sed -n 's/^Inst \([^ ]*\).*/\1/p') || return 1
    # Those that are installed but do not answer are unpacked as well. A second C library would
    # break every program that finds it; the driver does not run Python.
    wanted=$(printf '%s\n' $wanted "${packages[@]}" | sort -u |
        grep -vE '^(libc6|libc-bin|(lib)?python3.*)$')
    # shellcheck disable=SC2086 # one word per package
    (cd "$unpacked/debs" && "${apt[@]}" download $wanted) || return 1
    local deb
    for deb in "$unpacked"/debs/*.deb; do
        dpkg-deb -x "$deb" "$unpacked/root" || return 1
    done
}

# Points the loader at what unpack_adapter left, if it did.
use_unpacked() {
    local library json="$unpacked/lvp_icd.json"
    library=$(find "$unpacked/root" -name 'libvulkan_lvp.so' -print -quit 2>/dev/null)
    [[ -n "$library" ]] || return 1
    printf '{ "file_format_version": "1.0.0", "ICD": { "library_path": "%s", "api_version": "1.1.0" } }\n' \
        "$library" >"$json"
    # Debian keeps some libraries below /lib and others below /usr/lib.
    local places
    places=$(find "$unpacked/root" -name '*.so*' -printf '%h\n' | sort -u | paste -sd:)
    export LD_LIBRARY_PATH="$places${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
    export VK_ICD_FILENAMES="$json" VK_DRIVER_FILES="$json"
}

# Says what to install where this script does not do it.
name_package() {
    local names
    case "$(uname -s)" in
        Darwin) names="(Metal comes with macOS; a machine without it runs on the CPU alone)" ;;
        Linux)
            if command -v dnf >/dev/null; then
                names="mesa-vulkan-drivers vulkan-loader (dnf)"
            elif command -v pacman >/dev/null; then
                names="vulkan-swrast vulkan-icd-loader (pacman)"
            elif command -v apk >/dev/null; then
                names="mesa-vulkan-swrast vulkan-loader (apk)"
            elif command -v zypper >/dev/null; then
                names="libvulkan_lvp libvulkan1 (zypper)"
            else
                names="${packages[*]}"
            fi
            ;;
        *) names="a Vulkan driver, for example Mesa's lavapipe" ;;
    esac
    say "no adapter for the GPU path; what would bring one: $names"
}

set_up_adapter() {
    adapter_answers && return 0
    if command -v apt-get >/dev/null; then
        if may_install; then
            install_adapter >&2 && adapter_answers && return 0
        fi
        { use_unpacked && adapter_answers; } && return 0
        { unpack_adapter >&2 && use_unpacked && adapter_answers; } && return 0
    fi
    name_package
    return 1
}

# The program itself first, so that its build shows its progress and its errors.
cargo build --locked
if set_up_adapter; then
    # There is one: from here on a test that does not find it is at fault.
    export NNGTL_REQUIRE_GPU_TESTS=1
elif required; then
    say "FAILED: the tests of the GPU path are required and there is no adapter"
    exit 1
else
    say "SKIPPING the tests of the GPU path"
fi

cargo test --locked

# Training's tests need PyTorch, which is no part of this set-up.
if python3 -c 'import numpy, pytest, safetensors, torch' 2>/dev/null; then
    python3 -m pytest -q training
else
    say "SKIPPED: the tests of training/ (they need Python with PyTorch, see training/README.md)"
fi
