# The files of the library for C, its templates, tarballs, and who may install. scripts/build/install* and
# packaging/*/pack source this file in the top folder.

# as_owner NAME [--check]: returns if this user may write below $DESTDIR$PREFIX. Otherwise sudo runs this script again,
# scripts/build/NAME; with --check it only says so, before anything is built. Without sudo, and with MBM_INSTALL=no, it
# says what to do, and fails
as_owner() {
    below=$DESTDIR$PREFIX
    while [ ! -e "$below" ]; do below=$(dirname "$below"); done
    [ ! -w "$below" ] || [ ! -x "$below" ] || return 0
    if [ "${MBM_INSTALL:-}" = no ] || ! command -v sudo >/dev/null; then
        echo "$1: you may not write to $below. PREFIX=\$HOME/.local installs for you alone; root may say: make $1" >&2
        exit 1
    elif [ "${2:-}" ]; then
        echo "$1: $below is not yours, so sudo installs there in the end. PREFIX=\$HOME/.local installs for you alone"
    else
        exec sudo env "PREFIX=$PREFIX" "LIBDIR=${LIBDIR:-}" "DESTDIR=$DESTDIR" "PATH=$PATH" "scripts/build/$1"
    fi
}

# fill TEMPLATE OUTPUT: replaces the placeholders of a template by these variables of the shell:
#   prefix          the folder of the library, as pkg-config sees it
#   lib             the folder of the library, below prefix
#   up              the relative path from the folder of the CMake files to prefix
#   pointer         the bytes of a pointer in the library
#   link            what a linker needs beside the library: nothing, or -Wl,--gc-sections where the archive is one object
fill() {
    version=$(scripts/version)
    major=${version%%.*}
    minor=${version#*.}
    minor=${minor%%.*}
    install -d "$(dirname "$2")"
    sed -e "s|@PREFIX@|$prefix|g" -e "s|@INCLUDEDIR@|\${prefix}/include|g" \
        -e "s|@LIBDIR@|\${prefix}/$lib|g" -e "s|@LIB@|$lib|g" -e "s|@INCLUDE@|include|g" -e "s|@UP@|$up|g" \
        -e "s|@VERSION@|$version|g" -e "s|@MAJOR@|$major|g" -e "s|@MINOR@|$minor|g" \
        -e "s|@POINTER@|$pointer|g" -e "s|@LINK@|${link:+ $link}|g" "$1" >"$2"
    chmod 644 "$2"
}

# pack_tar FOLDER OUTPUT: packs a folder as a tarball whose bytes depend only on the names, contents and
# executable bits of its files. OUTPUT ends with .tar.gz; FOLDER is the tarball's top folder. All files
# get the time SOURCE_DATE_EPOCH; the default is 1980-01-02, because some file systems have no time
# before 1980.
pack_tar() {
    # A pipe would hide a failure of tar.
    LC_ALL=C tar --create --directory "$(dirname "$1")" --format=ustar --sort=name --owner=0 --group=0 --numeric-owner \
        --mtime="@${SOURCE_DATE_EPOCH:-315619200}" --mode=u=rwX,go=rX --file "$2.tar" "$(basename "$1")"
    gzip -n -9 <"$2.tar" >"$2.new"
    rm "$2.tar"
    mv "$2.new" "$2"
}
