# How packages reach registries. packaging/KIND/publish source this file: `make publish`.
#
#   publish PACKAGES     PACKAGES is the folder of finished packages, dist
#
# It uploads with MBM_PUBLISH=yes and the secret of its registry. Otherwise it is a dry run: everything but
# the upload.

# uploads KIND SECRET: whether this is no dry run; says so
uploads() {
    eval "secret=\${$2:-}"
    if [ "${MBM_PUBLISH:-}" = yes ] && [ -n "$secret" ]; then
        echo "publish: $1: uploads"
        return 0
    fi
    echo "publish: $1: a dry run, for lack of $([ "${MBM_PUBLISH:-}" = yes ] && echo "the secret $2" || echo MBM_PUBLISH=yes)"
    return 1
}

# one_package PATTERN: the package of this name
one_package() {
    set -- $1
    [ $# -eq 1 ] && [ -f "$1" ] || {
        echo "publish: there must be one package, but there are: $*" >&2
        exit 1
    }
    echo "$1"
}
