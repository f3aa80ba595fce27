# Completion of mbm for bash. The commands, options and words come from mbm itself.
# Install it as /usr/share/bash-completion/completions/mbm, or source it.
#
# Licence: MIT OR Apache-2.0.

# The words that an option of a command takes, if mbm lists them.
_mbm_words() {
    mbm "$1" "$2" '' 2>&1 | sed -n 's/.* is not one of \(.*\)\.$/\1/p' | sed 's/,//g; s/ and / /'
}

_mbm() {
    local line=${COMP_LINE:0:COMP_POINT} command word before words prefix
    local -a typed
    read -ra typed <<<"$line"
    command=${typed[1]:-}
    # A colon and = are in COMP_WORDBREAKS, but not the borders of a LINE.
    [[ $line == *' ' ]] && word= before=${typed[-1]} || word=${typed[-1]} before=${typed[-2]:-}
    COMPREPLY=()
    if [[ $command == "$word" || $before == help ]]; then
        words="$(mbm --help | sed -n '/^Commands:/,/^$/s/^  \([a-z]*\) .*/\1/p') help --help --version"
    elif [[ $word == -* ]]; then
        words=$(mbm "$command" --help | grep -o -e '--[a-z][a-z-]*')
    else
        case $before in
        --table | --type | --order | --category | --parities | --framing | --log-level | --discovery | --write-function | --accept | --close | -[a-zA-Z])
            words=$(_mbm_words "$command" "$before") ;;
        import) words=$(_mbm_words import '') ;;
        --rates) words="1200 2400 4800 9600 19200 38400 57600 115200" ;;
        esac
    fi
    if [[ -z ${words:-} ]]; then
        case $word in
        rtu:* | ascii:*)
            words=$(compgen -G "${word#*:}*" | grep -e '/tty' -e '/pts' -e '/dev$' | sed "s|^|${word%%:*}:|") ;;
        */* | ?*.*) ;;
        *) [[ $command == header || $command == import || $line =~ \ (rtu|ascii|(rtu\+)?tcp|udp|tls): ]] || words="rtu:/dev/tty ascii:/dev/tty tcp:// rtu+tcp:// udp:// tls://" ;;
        esac
        compopt -o nospace -o default 2>/dev/null
    fi
    mapfile -t COMPREPLY < <(compgen -W "${words:-}" -- "$word")
    # bash replaces only what follows the last colon.
    if [[ $word == *:* && $COMP_WORDBREAKS == *:* ]]; then
        prefix=${word%"${word##*:}"}
        COMPREPLY=("${COMPREPLY[@]#"$prefix"}")
    fi
}
complete -F _mbm mbm
