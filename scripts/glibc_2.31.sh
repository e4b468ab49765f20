# Sourced by scripts/package: an older system to compile against, Debian 11 with glibc 2.31, in a folder of .venv. Nothing
# of it is installed, and none of its programs run.
# shellcheck shell=bash

# unpack_system ARCHITECTURE PROCESSOR: in .venv/glibc_2.31-PROCESSOR, as Debian and as the kernel name the processor.
unpack_system() {
  local architecture=$1 processor=$2 from=packaging/python/glibc_2.31 folder release package name
  folder=$PWD/.venv/glibc_2.31-$2
  ! cmp -s "$from/packages.txt" "$folder/installed.txt" || return 0
  echo "Unpacking Debian 11 for $processor, 80 MB"
  rm -rf "$folder"
  for release in bullseye bookworm; do
    mkdir -p "$folder/$release/lists/partial" "$folder/$release/packages"
    : >"$folder/$release/status"
    download "$architecture" "$folder/$release" "$release"
    # Of Debian 12 headers and what the compiler has of its own.
    find "$folder/$release/packages" -name '*.deb' -exec dpkg-deb -x {} "$folder" ';'
  done
  for package in "$folder"/*/packages/*.deb; do  # For the licences of what comes along.
    name=$(basename "$package")
    dpkg-deb -c "$package" | sed -n "s|^[-l][^>]*/\([^/ ]*\.so\.[^/ ]*\)\( -> .*\)\?$|\1 ${name%%_*}|p"
  done >"$folder/libraries.txt"
  rm -r "$folder/bullseye" "$folder/bookworm"
  clang --target="$processor-linux-gnu" --sysroot="$folder" -O2 -fPIC -c "$from/newer_glibc.c" -o "$folder/newer_glibc.o"
  # Links lead into the folder, not into this system.
  find "$folder" -type l -lname '/*' -printf '%p %l\n' | while read -r link target; do ln -sfn "$folder$target" "$link"; done
  cp "$from/packages.txt" "$folder/installed.txt"
}

# sources RELEASE: where packages of that release of Debian are, as apt has it: on the mirrors of this system.
sources() {
  local signed="[signed-by=/usr/share/keyrings/debian-archive-keyring.gpg]" mirror
  apt-get indextargets --format '$(REPO_URI)' 'Origin: Debian' 'Created-By: Packages' | sort -u | while read -r mirror; do
    case $mirror in
      *security*) echo "deb $signed $mirror $1-security main" ;;
      *) echo "deb $signed $mirror $1 main" ;;
    esac
  done
}

# download ARCHITECTURE FOLDER RELEASE: what packages.txt names of that release. Not every mirror has the security updates of
# an old release for each processor: then as it was released.
download() {
  sources "$3" >"$2/debian.list"
  fetch_packages "$@" 2>"$2/log" && return 0
  echo "Debian's security updates of $3 for $1 cannot be fetched; its packages come without them"
  sed -i '/-security main$/d' "$2/debian.list"
  fetch_packages "$@" 2>"$2/log" || { cat "$2/log" >&2; return 1; }
}

fetch_packages() {
  local names=() apt=(apt-get -qq -o "APT::Architecture=$1" -o "APT::Architectures=$1" -o "Dir::State::status=$2/status"
    -o "Dir::State::Lists=$2/lists" -o "Dir::Etc::sourcelist=$2/debian.list" -o Dir::Etc::sourceparts=/dev/null
    -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache= -o APT::Sandbox::User=)
  "${apt[@]}" update || return 1
  mapfile -t names < <(sed -n "s/^$3 //p" packaging/python/glibc_2.31/packages.txt)
  if [ "$3" = bullseye ]; then  # With what they depend on.
    mapfile -t names < <("${apt[@]}" --simulate install --no-install-recommends "${names[@]}" | awk '$1 == "Inst" { print $2 }')
  fi
  (cd "$2/packages" && "${apt[@]}" download "${names[@]}")
}
