/* The commands of mbm, each in a file of its own. A command gets its own arguments, the first of
 * which is "mbm" and its name, and returns an exit code: one of CODE_ of report.h.
 *
 * Licence: MIT OR Apache-2.0. */
#ifndef COMMANDS_H
#define COMMANDS_H

int read_command(int argc, char **argv);
int write_command(int argc, char **argv);
int call_command(int argc, char **argv);
int scan_command(int argc, char **argv);
int identify_command(int argc, char **argv);
int poll_command(int argc, char **argv);
int serve_command(int argc, char **argv);
int sniff_command(int argc, char **argv);
int gateway_command(int argc, char **argv);
int header_command(int argc, char **argv);
int bridge_command(int argc, char **argv);

#endif
