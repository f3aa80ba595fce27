/**
 * @file mbm/server.h
 * @brief The server, and the data of the units that it serves.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_SERVER_H
#define MBM_SERVER_H

#include "packets.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ==== Units: the data that servers serve: tables, callbacks, files ================== */

/** A function of yours returns this, or-ed with the exception code (1 to 127), to answer
 *  with an exception. */
#define MBM_REPLY_EXCEPTION 256u
/** A function of yours returns this to send no response. */
#define MBM_REPLY_NONE 512u
/** A function of yours returns this if it has not finished. The next poll calls it again
 *  with the same request. The server receives nothing meanwhile. */
#define MBM_REPLY_PENDING 768u
/** A function of yours returns this to decline the request: the next record of the unit that
 *  serves the function code answers, or exception 01 if there is none. */
#define MBM_REPLY_DECLINED 1024u
/** The most records that one unit can serve. Each is one struct that you pass to a
 *  mbm_unit_serve function. */
#define MBM_MAX_SERVICES 16

/** The head of each record that a mbm_unit_serve function takes. Private. */
typedef struct mbm_service {
    /** Serves a request if its function belongs to this record. NULL in a zeroed record,
     *  which serves nothing. */
    size_t (*serve)(struct mbm_service *service, uint8_t *pdu, const void *info);
    /** The kind of the record within its family, from 1 on; 0 in a zeroed record. */
    uint8_t kind;
} mbm_service;

/**
 * The counters, the event log and the listen only mode of a unit. Initialise the struct with
 * MBM_INIT and pass it to mbm_unit_serveDiagnostics. The counters wrap at 65536; you may read
 * them at any time. The sub-functions below are those of function 08 (V1.1b3, 6.8), in hex.
 */
typedef struct mbm_diagnostics {
    mbm_service service; /**< Private. */
    /** Optional: called when the client restarts the communications (sub-function 01).
     *  `clearLog` is 1 if the client cleared the event log too, else 0. */
    void (*restart)(void *context, uint8_t clearLog);
    /** Passed to `restart`. Any value; may be NULL. */
    void *context;
    /** The value that sub-function 02 returns. You set it. */
    uint16_t diagnosticRegister;
    /** Sub-function 0B: frames with a right CRC, for any unit. */
    uint16_t busMessages;
    /** Sub-function 0C: damaged frames. */
    uint16_t busCommunicationErrors;
    /** Sub-function 0D: exceptions, including those that broadcasts caused. */
    uint16_t exceptionErrors;
    /** Sub-function 0E: requests for this unit, and broadcasts. */
    uint16_t serverMessages;
    /** Sub-function 0F: requests without a response. */
    uint16_t noResponses;
    /** Sub-function 10: exceptions with code 07. */
    uint16_t naks;
    /** Sub-function 11: exceptions with code 06. */
    uint16_t busy;
    /** Sub-function 12: frames that were too long for the buffer. */
    uint16_t characterOverruns;
    /** The event count that function 0B returns: requests that were carried out. */
    uint16_t events;
    /** 1 in listen only mode, else 0. */
    uint8_t listenOnly;
    uint8_t hidden[67]; /**< Private. */
} mbm_diagnostics;

/**
 * A unit that servers answer for. Initialise it with MBM_INIT, set `id`, and call an
 * mbm_unit_serve function, for example mbm_unit_serveCoils, for everything that it serves.
 *
 * Each mbm_unit_serve function takes a record: a struct of yours, which must stay valid
 * for as long as the unit is used. A unit has places for MBM_MAX_SERVICES records; one
 * more returns MBM_BUFFER_TOO_SMALL. You may pass a record again, also after you have
 * zeroed and refilled it; it keeps its place. A zeroed record serves nothing until you
 * pass it again. Any number of units may share one record.
 *
 * A unit may have several tables of one kind, for example holding registers 0 to 9 and 40000
 * to 40099; the same holds for callbacks, files and FIFO queues. The unit asks them in the
 * order of their registration. The first one that has all cells of a request answers it. If
 * none has all of them, the unit answers with exception 02, also where several have them
 * together.
 */
typedef struct mbm_unit {
    /** Private: the records in the order in which the unit calls them. NULL follows the
     *  last one. */
    mbm_service *services[MBM_MAX_SERVICES];
    /** Private: NULL in a unit without diagnostics. */
    size_t (*monitor)(struct mbm_unit *unit,
                      const void *info,
                      uint8_t addressing,
                      uint8_t *pdu);
    mbm_diagnostics *diagnostics; /**< Private. */
    /** The unit id, 1 to 247 (serial line guide V1.02, 2.2). The ids 248 to 255, which
     *  the standard reserves, are accepted. 0 answers to every id. A unit without any
     *  record does not answer. A begin function of a server refuses a greater id
     *  (MBM_INVALID_ARGUMENT). If you set one later, no request has it. */
    uint16_t id;
} mbm_unit;

/**
 * A request that reads or writes cells of yours, as your hooks get it. A cell is a register,
 * a coil, a discrete input or a record of a file.
 */
typedef struct mbm_access {
    /** The new values, in the hooks of a write: registers and records with the high byte
     *  first, bits with the lowest bit of the first byte first. NULL in beforeRead. Valid
     *  until the hook returns. */
    const uint8_t *data;
    /** The line or connection that the request came from: the `context` of the port of the
     *  server that received it, or the `connection` of mbm_unit_respond. */
    void *connection;
    /** The address of the first cell; for a file, the number of the first record. */
    uint16_t address;
    /** How many cells, 1 to 2000. */
    uint16_t quantity;
    /** The number of the file; 0 for tables and callbacks. */
    uint16_t file;
    /** The unit id in the request. 0 on a serial line is a broadcast. */
    uint8_t unit;
    /** The function code of the request. */
    uint8_t function;
} mbm_access;

/**
 * Functions of yours that the server calls around a read or a write of cells. Each is
 * optional. Pass the struct to mbm_registerTable_setHooks, mbm_bitTable_setHooks,
 * mbm_dataCallbacks_setHooks or mbm_files_setHooks. It may be a constant, and any number
 * of records may share it.
 *
 * The server calls the hooks only for a request that is right and whose cells all exist.
 * Functions 16 and 17 (hex) read and write: for them the server calls beforeRead,
 * beforeWrite and afterWrite in this order. A request of function 14 or 15 (hex) has one or
 * more groups of records, and the server calls each hook once for each group. It calls
 * beforeWrite for all groups before it writes any of them.
 *
 * A hook may change cells. It may call any function of this library but those on the
 * server that calls it, which return MBM_BUSY. If it changes its record, or sets other
 * hooks for it, that counts from the next request on.
 */
typedef struct mbm_accessHooks {
    /** Your pointer, passed to each hook; may be NULL. */
    void *context;
    /** Called before cells are read. It may refresh them. Returns 0 to allow the read, or an
     *  exception code to refuse the whole request; a number above 127 becomes exception 04. */
    uint8_t (*beforeRead)(void *context, const mbm_access *access);
    /** Called before cells are written. Returns as beforeRead. */
    uint8_t (*beforeWrite)(void *context, const mbm_access *access);
    /** Called after cells were written. */
    void (*afterWrite)(void *context, const mbm_access *access);
} mbm_accessHooks;

/** The hooks of a record. Private. */
typedef struct mbm_recordHooks {
    /** The hooks. */
    const mbm_accessHooks *hooks;
    /** Calls the hooks. NULL if there are none. A program in which no record has hooks does
     *  not contain the function. */
    void (*call)(void);
} mbm_recordHooks;

/**
 * Cells that your functions get and set one by one, in place of an array. A cell is a
 * register, a coil or a discrete input. Initialise the struct with MBM_INIT, set the fields
 * that you need, and pass it to mbm_unit_serveCallbacks.
 */
typedef struct mbm_dataCallbacks {
    mbm_service service; /**< Private. */
    /** Passed to each function. Any value; may be NULL. */
    void *context;
    /** Optional; NULL if every address exists. Otherwise returns 1 if this address
     *  exists, else 0. A request for an address that does not exist is answered with
     *  exception 02. */
    uint8_t (*isValid)(void *context, uint16_t address);
    /**
     * Required. Returns the value of an existing cell; for a bit, 0 is off and any other value on.
     */
    uint16_t (*get)(void *context, uint16_t address);
    /** Sets an existing cell; a bit to 0 or 1. Coils and holding registers without it are
     *  read-only: the unit answers functions that write them with exception 01, unless a
     *  later record serves these functions. */
    void (*set)(void *context, uint16_t address, uint16_t value);
    /** Private: see mbm_dataCallbacks_setHooks. */
    mbm_recordHooks hooks;
} mbm_dataCallbacks;

/** A request for a function of yours. */
typedef struct mbm_request {
    /** The data of the request: the bytes after the function code. */
    const uint8_t *data;
    /** The line or connection that the request came from: the `context` of the port of the
     *  server that received it, or the `connection` of mbm_unit_respond. */
    void *connection;
    /** Length of `data` in bytes, 0 to 252. */
    uint16_t length;
    /** The unit id in the request. 0 on a serial line is a broadcast: the server then
     *  sends no response. */
    uint8_t unit;
    /** The function code. */
    uint8_t function;
} mbm_request;

/**
 * A function of yours. Initialise the struct with MBM_INIT, set the fields that you need, and
 * pass it to mbm_unit_serveCustom.
 *
 * A unit asks its records in the order of their registration. So a function that is
 * registered before the record that serves the same code is asked first. It answers the
 * request itself, for example with an exception, or it returns MBM_REPLY_DECLINED: then the
 * record after it answers. A function that is registered after tables with its code is asked
 * for the cells that they lack; a function with code 0 is not.
 */
typedef struct mbm_custom {
    mbm_service service; /**< Private. */
    /** Carries out a request and writes the data of the response, without the function
     *  code, to `response`. `capacity` is the space in bytes that the frame buffer has
     *  after the request; the server sends at most 252 bytes. Returns the number of bytes
     *  written, or MBM_REPLY_EXCEPTION | code, or MBM_REPLY_NONE, MBM_REPLY_PENDING or
     *  MBM_REPLY_DECLINED. */
    uint16_t (*serve)(void *context,
                      const mbm_request *request,
                      uint8_t *response,
                      uint16_t capacity);
    /** Passed to `serve`. Any value; may be NULL. */
    void *context;
    /** The function code, 1 to 127. 0 means every function that no earlier record of the
     *  unit serves. The standard reserves 65 to 72 and 100 to 110 for users (V1.1b3, 5). */
    uint8_t code;
    /** The length of the request PDUs, which a server of RTU over TCP needs. If it is
     *  zeroed, a request is complete when its CRC is right. */
    mbm_rule length;
} mbm_custom;

/**
 * The functions that a unit answers with exception 01, even if it could serve them: see
 * mbm_unit_switchFunction.
 */
typedef struct mbm_functionMask {
    mbm_service service; /**< Private. */
    uint8_t off[16]; /**< Private. */
} mbm_functionMask;

/** One file: an array of records. A record is one register. */
typedef struct mbm_file {
    /** The records, starting with record 0. */
    uint16_t *records;
    /** How many records the file has, at most 10000. */
    uint16_t size;
    /** The file number, 1 to 65535. */
    uint16_t number;
} mbm_file;

/**
 * Files of yours. Initialise the struct with MBM_INIT, set the fields that you need, and pass
 * it to mbm_unit_serveFiles.
 */
typedef struct mbm_files {
    mbm_service service; /**< Private. */
    /** The files: an array of `count` elements. */
    const mbm_file *files;
    /** How many files. */
    uint16_t count;
    /** Private: see mbm_files_setHooks. */
    mbm_recordHooks hooks;
} mbm_files;

/** One FIFO queue of registers. */
typedef struct mbm_fifo {
    /** The registers, the oldest first. */
    const uint16_t *words;
    /** The address of the queue (the FIFO pointer address). */
    uint16_t address;
    /** How many registers the queue holds now. If there are more than 31, the server
     *  answers with exception 03 (V1.1b3, 6.18). */
    uint16_t count;
} mbm_fifo;

/**
 * FIFO queues of yours. Initialise the struct with MBM_INIT, set `fifos` and `count`, and
 * pass it to mbm_unit_serveFifos.
 */
typedef struct mbm_fifos {
    mbm_service service; /**< Private. */
    /** The queues: an array of `count` elements. A read leaves the registers in the
     *  queue. */
    const mbm_fifo *fifos;
    /** How many queues. */
    uint16_t count;
} mbm_fifos;

/**
 * The eight exception status outputs of function 07. Initialise the struct with MBM_INIT and
 * pass it to mbm_unit_serveExceptionStatus.
 */
typedef struct mbm_exceptionStatus {
    mbm_service service; /**< Private. */
    /** The outputs, one bit each. You may change them at any time. */
    uint8_t outputs;
} mbm_exceptionStatus;

/**
 * The response of function 11 (hex), Report Server ID. Initialise the struct with MBM_INIT,
 * set the fields that you need, and pass it to mbm_unit_serveServerId. The id, the run
 * indicator (1 byte) and the additional data together have at most 251 bytes, fewer if the
 * frame buffer holds less than a whole frame. If they are longer, the server answers with
 * exception 04.
 */
typedef struct mbm_serverId {
    mbm_service service; /**< Private. */
    /** The server id; NULL only if idLength is 0. */
    const uint8_t *id;
    /** The data after the run indicator; NULL only if additionalLength is 0. */
    const uint8_t *additional;
    /** Length of `id` in bytes. */
    uint8_t idLength;
    /** Length of `additional` in bytes. */
    uint8_t additionalLength;
    /** The run indicator: 0 is sent as 00, any other value as FF (hex). */
    uint8_t running;
} mbm_serverId;

/**
 * A device identification. Initialise the struct with MBM_INIT, set `objects` and `count`,
 * and pass it to mbm_unit_serveIdentification.
 */
typedef struct mbm_serverIdentification {
    mbm_service service; /**< Private. */
    /** The objects, in any order. Every device has the ids 0 (vendor name), 1 (product
     *  code) and 2 (revision). Optional are 3 (vendor URL), 4 (product name), 5 (model
     *  name) and 6 (application name), and from 0x80 on your own. An object has at most
     *  244 bytes. */
    const mbm_object *objects;
    /** How many objects. */
    uint16_t count;
} mbm_serverIdentification;

/**
 * Holding registers or input registers in an array of yours. Initialise the struct with
 * MBM_INIT, set the fields that you need, and pass it to mbm_unit_serveHoldingRegisters or
 * mbm_unit_serveInputRegisters. You may change the registers at any time, and the fields too,
 * except from within a hook of this table: the server finishes a request with the `words`
 * that the table had when the request came. To serve the struct as another kind of table,
 * zero it first.
 */
typedef struct mbm_registerTable {
    mbm_service service; /**< Private. */
    /** The registers: `size` words. */
    uint16_t *words;
    /** Optional; NULL if every register exists. Otherwise a bitmap with one bit for each
     *  register, the lowest bit of the first byte first. A request for a register whose
     *  bit is 0 is answered with exception 02. */
    const uint8_t *valid;
    /** Private: see mbm_registerTable_setHooks. */
    mbm_recordHooks hooks;
    /** The address of the first register. */
    uint16_t base;
    /** How many registers there are. */
    uint16_t size;
} mbm_registerTable;

/**
 * Coils or discrete inputs in an array of yours, eight bits in a byte, the lowest bit
 * first. Use it as mbm_registerTable, with mbm_unit_serveCoils or
 * mbm_unit_serveDiscreteInputs.
 */
typedef struct mbm_bitTable {
    mbm_service service; /**< Private. */
    /** The bits: `size` bits, in (size + 7) / 8 bytes. */
    uint8_t *bits;
    /** As in mbm_registerTable. */
    const uint8_t *valid;
    /** Private: see mbm_bitTable_setHooks. */
    mbm_recordHooks hooks;
    /** The address of the first bit. */
    uint16_t base;
    /** How many bits there are. */
    uint16_t size;
} mbm_bitTable;

/**
 * Serves cells that your functions get and set.
 *
 * @param cells  must stay valid for as long as the unit is used
 * @param table  the table, named by the function that reads it: 1 coils (functions 01, 05, 0F), 2
 *               discrete inputs (02), 3 holding registers (03, 06, 10, 16, 17), 4 input registers
 *               (04); functions in hex
 * @return a status; see mbm_unit_serveCoils. MBM_INVALID_ARGUMENT for a NULL `get`
 */
uint8_t mbm_unit_serveCallbacks(mbm_unit *unit, mbm_dataCallbacks *cells, uint8_t table);

/**
 * Sets the functions that are called around a read or a write of cells, or removes them.
 *
 * @param cells  the cells, registered already or not. Zeroing the struct removes the hooks
 * @param hooks  must stay valid for as long as the cells are served; NULL for no hooks
 */
uint8_t mbm_dataCallbacks_setHooks(mbm_dataCallbacks *cells, const mbm_accessHooks *hooks);

/**
 * Serves a function of yours, in every framing.
 *
 * @return a status; see mbm_unit_serveFiles. MBM_INVALID_ARGUMENT for a NULL `serve`, a code above
 *         127 or an invalid `length`
 */
uint8_t mbm_unit_serveCustom(mbm_unit *unit, mbm_custom *custom);

/**
 * Switches a function of a unit off or on. The unit answers a function that is off with
 * exception 01, even if a record serves it.
 *
 * @param mask  must stay valid for as long as the unit is used; initialised with MBM_INIT. Units
 *              that share a mask have the same functions off
 * @param code  the function code, 1 to 127
 * @param on    0 switches the function off, anything else switches it on
 * @return a status; see mbm_unit_serveFiles
 */
uint8_t mbm_unit_switchFunction(mbm_unit *unit, mbm_functionMask *mask, uint8_t code, uint8_t on);

/**
 * Serves diagnostics: functions 08, 0B and 0C (hex). Function 08 has the sub-functions
 * of the standard, 00 to 04, 0A to 12 and 14 (hex); it answers others with exception 01
 * (illegal function). After this call the unit counts the frames on its lines and logs
 * events, and a client can force it into listen only mode.
 *
 * @param diagnostics  must stay valid for as long as the unit is used. Use one struct for each
 *                     unit: a shared one counts for all units that share it
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
 */
uint8_t mbm_unit_serveDiagnostics(mbm_unit *unit, mbm_diagnostics *diagnostics);

/**
 * Serves files: functions 14 and 15 (hex), Read File Record and Write File Record. A
 * request is carried out completely or not at all. Serving a request takes 250 bytes of
 * stack.
 *
 * @return a status; MBM_BUFFER_TOO_SMALL if the unit has MBM_MAX_SERVICES records already
 */
uint8_t mbm_unit_serveFiles(mbm_unit *unit, mbm_files *files);

/**
 * Sets the functions that are called around a read or a write of records, or removes them.
 * In mbm_access, `file` is the number of the file and `address` the first record.
 *
 * @param files  the files, registered already or not. Zeroing the struct removes the hooks
 * @param hooks  must stay valid for as long as the files are served; NULL for no hooks
 */
uint8_t mbm_files_setHooks(mbm_files *files, const mbm_accessHooks *hooks);

/**
 * Serves FIFO queues: function 18 (hex), Read FIFO Queue.
 *
 * @return a status; see mbm_unit_serveFiles
 */
uint8_t mbm_unit_serveFifos(mbm_unit *unit, mbm_fifos *fifos);

/**
 * Serves function 07, Read Exception Status.
 *
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
 */
uint8_t mbm_unit_serveExceptionStatus(mbm_unit *unit, mbm_exceptionStatus *status);

/**
 * Serves function 11 (hex), Report Server ID.
 *
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
 */
uint8_t mbm_unit_serveServerId(mbm_unit *unit, mbm_serverId *id);

/**
 * Serves function 2B/0E (hex), Read Device Identification: streams of objects, and
 * single objects. If the objects do not fit into one response, the client reads the rest
 * with further requests. The server computes the conformity level from the objects that
 * exist.
 *
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY if the unit serves another such record
 */
uint8_t mbm_unit_serveIdentification(mbm_unit *unit, mbm_serverIdentification *identification);

/**
 * Answers one request without a server: reads a request frame from a buffer and writes
 * the response frame over it.
 *
 * @param units       the units to serve: one unit, or an array of units
 * @param count       how many units
 * @param connection  your pointer, which hooks and functions of yours get as the connection
 *                    that the request came from; may be NULL
 * @param framing     the framing. Its `functions` are not used: units know their own functions
 * @param frame       holds the complete request; receives the response
 * @param length      length of the request in bytes
 * @param capacity    size of `frame` in bytes. 256 hold every response in RTU, 513 in ASCII,
 *                    260 in TCP. A longer response becomes exception 04
 * @param response    receives the length of the response in bytes; 0 without a response: after
 *                    a damaged frame, a request for another unit, a broadcast, and with any
 *                    status but MBM_OK
 * @return a status; MBM_PENDING if a function of yours returned MBM_REPLY_PENDING: write the
 *         request into `frame` again before the next call; MBM_INVALID_ARGUMENT for a unit with
 *         an id above 255
 */
uint8_t mbm_unit_respond(mbm_unit *units, uint8_t count, void *connection,
                         const mbm_framing *framing, uint8_t *frame, uint16_t length,
                         uint16_t capacity, uint16_t *response);

/**
 * Sets the functions that are called around a read or a write of registers, or removes them.
 *
 * @param table  the table, registered already or not. Zeroing the struct removes the hooks
 * @param hooks  must stay valid for as long as the table is served; NULL for no hooks
 */
uint8_t mbm_registerTable_setHooks(mbm_registerTable *table, const mbm_accessHooks *hooks);

/**
 * Sets the functions that are called around a read or a write of bits, or removes them.
 *
 * @param table  the table, registered already or not. Zeroing the struct removes the hooks
 * @param hooks  must stay valid for as long as the table is served; NULL for no hooks
 */
uint8_t mbm_bitTable_setHooks(mbm_bitTable *table, const mbm_accessHooks *hooks);

/**
 * Serves coils: functions 01, 05 and 0F (hex).
 *
 * @return a status; see mbm_unit_serveFiles. MBM_BUSY for a table that is served as another
 *         kind
 */
uint8_t mbm_unit_serveCoils(mbm_unit *unit, mbm_bitTable *table);

/**
 * Serves discrete inputs: function 02.
 *
 * @return a status; see mbm_unit_serveCoils
 */
uint8_t mbm_unit_serveDiscreteInputs(mbm_unit *unit, mbm_bitTable *table);

/**
 * Serves holding registers: functions 03, 06 and 10 (hex). For functions 16 and 17 too,
 * call mbm_registerTable_serveMaskAndReadWrite afterwards.
 *
 * @return a status; see mbm_unit_serveCoils
 */
uint8_t mbm_unit_serveHoldingRegisters(mbm_unit *unit, mbm_registerTable *table);

/**
 * Serves input registers: function 04.
 *
 * @return a status; see mbm_unit_serveCoils
 */
uint8_t mbm_unit_serveInputRegisters(mbm_unit *unit, mbm_registerTable *table);

/**
 * Adds functions 16 and 17 (hex), Mask Write Register and Read/Write Multiple Registers,
 * to a table of holding registers, on every unit that serves the table. It is a function
 * of its own so that firmware without these two is smaller. Call it again after you have
 * zeroed the table.
 *
 * @param table  holding registers that mbm_unit_serveHoldingRegisters accepted
 * @return a status; MBM_INVALID_ARGUMENT for any other table
 */
uint8_t mbm_registerTable_serveMaskAndReadWrite(mbm_registerTable *table);

/* ==== Server: answers requests on a line or connection ============================== */

/**
 * A Modbus server on one serial line or one connection.
 *
 * You provide the storage. Initialise it with MBM_INIT. A server serves units. Several
 * servers may share units: for example, a server on a serial line and four servers on TCP
 * connections are five servers with the same units. Use a server and its units from one
 * thread, and never from an interrupt. Use all servers that share units from the same thread.
 *
 * mbm_server_poll calls your hooks and your functions. If they call a function on the
 * server that is being polled, it returns MBM_BUSY and changes nothing; call it after
 * mbm_server_poll has returned. They may call functions on other servers, and the
 * mbm_unit_serve functions on any unit.
 */
typedef struct mbm_server {
    void *pointers[16]; /**< Private. */
    uint32_t words[10]; /**< Private. */
} mbm_server;

/**
 * Begins a server for RTU on a serial line. The baud rate is unknown at first, so 4 ms
 * of silence end a frame: see mbm_server_setBaudRate.
 *
 * You may call it again at any time, but not from within a hook of the server. The server then
 * drops the request that it serves and the response that it sends; if it was sending, it calls
 * postTransmission of the previous port to switch the driver off. A call that fails changes
 * nothing. The function does not open the port. The units and the buffer must stay valid, at
 * the same address, for as long as the server is used. Several servers may share units. The
 * buffer holds no data between requests.
 *
 * @param port   is copied; its hooks read, write and micros are required
 * @param units  the units to serve: one unit, or an array of units
 * @param count  how many units
 * @param frame  buffer for one frame, a request or a response
 * @param bytes  size of `frame` in bytes, at least 16. MBM_MAX_FRAME holds every frame. The server
 *               ignores a longer request, and answers exception 04 in place of a longer response
 * @return a status; MBM_INVALID_ARGUMENT for a unit with an id above 255
 */
uint8_t mbm_server_beginRtu(mbm_server *server, const mbm_port *port, mbm_unit *units,
                            uint8_t count, uint8_t *frame, uint16_t bytes);

/**
 * Begins a server for ASCII on a serial line (serial line guide V1.02, 2.5.2). The
 * server drops a frame if the next character takes longer than one second.
 *
 * @param bytes  size of `frame` in bytes, at least 32; MBM_MAX_ASCII_FRAME holds every frame
 * @return a status; see mbm_server_beginRtu
 */
uint8_t mbm_server_beginAscii(mbm_server *server, const mbm_port *port, mbm_unit *units,
                              uint8_t count, uint8_t *frame, uint16_t bytes);

/**
 * Begins a server on an accepted TCP connection. If several requests are in the stream,
 * the server answers them in order.
 *
 * @param port   see mbm_server_beginRtu; its hooks read and write the connection and give the time
 * @param units  see mbm_server_beginRtu; the unit ids 0 and 255 address the first unit
 * @param frame  see mbm_server_beginRtu; one for each connection
 * @param bytes  size of `frame` in bytes, at least MBM_MAX_TCP_FRAME
 * @return a status; see mbm_server_beginRtu
 */
uint8_t mbm_server_beginTcp(mbm_server *server, const mbm_port *port, mbm_unit *units,
                            uint8_t count, uint8_t *frame, uint16_t bytes);

/**
 * Begins a server for a stream of RTU frames without timing: a TCP connection that
 * carries RTU, or a serial adapter that delivers bytes in blocks. The server finds the
 * end of a frame from its bytes. After a damaged frame, half a second of silence ends
 * the damaged bytes.
 *
 * @param units  see mbm_server_beginRtu; the unit ids 0 and 255 address the first unit
 * @param frame  see mbm_server_beginRtu; one for each connection
 * @param bytes  size of `frame` in bytes, at least 16; MBM_MAX_FRAME holds every frame
 * @return a status; see mbm_server_beginRtu
 */
uint8_t mbm_server_beginRtuOverTcp(mbm_server *server, const mbm_port *port, mbm_unit *units,
                                   uint8_t count, uint8_t *frame, uint16_t bytes);

/**
 * Polls the server, without waiting: receives bytes, carries out a complete request, and
 * sends the response.
 *
 * Call it often: at least once per character time of the line if nothing else buffers
 * received bytes. On a serial line the response starts with the first call after the
 * line has been silent for t3.5.
 *
 * @return a status; MBM_LINK_LOST if the port reported that the connection is lost: close it;
 *         MBM_MALFORMED_FRAME if the bytes received over TCP are not Modbus: close the connection
 */
uint8_t mbm_server_poll(mbm_server *server);

/**
 * Returns how long the program may sleep before the next mbm_server_poll, unless bytes
 * arrive earlier. Do not sleep longer: while a response leaves on a serial line, the driver would
 * go off late.
 *
 * @return microseconds. 0: poll now; a call from within a hook of this server returns 0 too.
 *         0xFFFFFFFF: sleep until the port has bytes to read; also for NULL and for a server that
 *         was never begun. After a response on a serial line it is first the time in which an echo
 *         may arrive. 1000: a function of yours has returned MBM_REPLY_PENDING, or a connection
 *         does not accept the response yet; the server receives no bytes meanwhile, so do not wait
 *         for one, but poll earlier if you know that the function or the connection is ready.
 *         Afterwards, and after a begin function, it is 0 until mbm_server_poll has read the port,
 *         so bytes that arrived meanwhile need not end a sleep
 */
uint32_t mbm_server_pollDelay(const mbm_server *server);

/**
 * Sets the silence that ends a frame. In RTU it is t3.5, in ASCII the longest time
 * between two characters, in RTU over TCP the silence after a damaged frame. It has no
 * effect in TCP. The begin functions restore the default.
 *
 * @param silenceUs  microseconds since the last received byte; a value above 2^31 (36 minutes)
 *                   counts as 2^31
 */
uint8_t mbm_server_setSilence(mbm_server *server, uint32_t silenceUs);

/**
 * Sets the baud rate from which an RTU server computes t3.5 (serial line guide V1.02,
 * 2.5.1.1), and how long missing bytes of a request take. It does not change the rate of the
 * line. Other framings do not use t3.5: see mbm_server_setSilence.
 *
 * @param baud  bits per second; 0 if the rate is unknown, as after mbm_server_beginRtu
 * @return a status; MBM_INVALID_ARGUMENT for other framings
 */
uint8_t mbm_server_setBaudRate(mbm_server *server, uint32_t baud);

/**
 * Sets how long a UART or an adapter may hold received bytes back on an RTU line: the latency
 * timer of a USB adapter, the threshold of a FIFO, the tick of a scheduler. If a request to one
 * of the units lacks bytes that its first bytes announce after t3.5, the server waits for as long
 * as the missing bytes and ten more take at the baud rate, and for this time. A longer time does
 * not delay complete requests. The begin functions restore the default.
 *
 * @param latencyMs  0 to 65535 ms; 50 ms after a begin function
 */
uint8_t mbm_server_setReceiveLatency(mbm_server *server, uint16_t latencyMs);

/**
 * Says whether the receiver of an RTU line gets the bytes that the driver sends (a local
 * echo). Without this call the server finds out: it drops a frame that is byte for byte its
 * last response, until another frame, or none in time, has followed a response. A client whose
 * very first requests are the same write again and again, each less than 80 ms after the
 * response, then loses some of them: say that there is no echo. mbm_server_beginRtu takes the
 * answer back.
 *
 * @param on  0: there is none, so no request is taken for it; anything else: there is one, even if
 *            a response came without it
 * @return a status; MBM_INVALID_ARGUMENT for other framings
 */
uint8_t mbm_server_setEchoDiscard(mbm_server *server, uint8_t on);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_SERVER_H */
