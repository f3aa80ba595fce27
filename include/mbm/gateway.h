/**
 * @file mbm/gateway.h
 * @brief The gateway: from Modbus TCP to the lines of clients.
 *
 * Licence: MIT OR Apache-2.0. Generated from the source of mbm; do not edit. A part of
 * mbm.h, at whose head are the rules of every function.
 */

#ifndef MBM_GATEWAY_H
#define MBM_GATEWAY_H

#include "client.h"

#ifdef __cplusplus
extern "C" {
#endif

struct mbm_unit;

/* ==== Gateway: from Modbus TCP to the lines of clients ============================== */

/** The `line` of a route for broadcasts: to all lines, one after the other. */
#define MBM_GATEWAY_ALL_LINES 255u
/** The `line` of a route to the gateway's own units: see mbm_gateway_serveUnits. */
#define MBM_GATEWAY_LOCAL 254u
/** The `unit` of a route whose first unit id is 0 on the line, but not on TCP. */
#define MBM_GATEWAY_UNIT_0 256u

/**
 * A gateway: takes requests from Modbus TCP connections, passes each to the line of its unit,
 * and sends the reply back. mbm_gateway_poll does all of it; no function ever waits.
 *
 * You provide the storage. Initialise it with MBM_INIT. Call mbm_gateway_begin first. Use a
 * gateway, its lines' clients and its own units from one thread, and never from an interrupt.
 *
 * mbm_gateway_poll calls the hooks of the connections' ports and of the lines' ports,
 * `isReady` of the lines, and the functions of the gateway's own units. If one of them calls a
 * function on the gateway, the function returns MBM_BUSY and changes nothing; a getter returns
 * its value for an object that was never begun. The same holds for the `done` function of a
 * request of your own that mbm_gateway_poll ends.
 */
typedef struct mbm_gateway {
    void *pointers[13]; /**< Private. */
    uint32_t words[2]; /**< Private. */
} mbm_gateway;

/**
 * Leads requests for a range of unit ids on TCP to a line. A table of routes may be constant.
 * The first route that has the unit id counts. Examples:
 *
 * - {1, 31, 0, 0}: the units 1 to 31, on line 0 with the same ids
 * - {101, 131, 1, 1}: the units 101 to 131, which have the ids 1 to 31 on line 1
 * - {255, 255, 0, 5}: a client that addresses the gateway itself reaches unit 5 on line 0
 *   (messaging on TCP/IP guide V1.0b, 4.4.1.2). The same with 0 instead of 255
 * - {0, 0, 0, 0}: unit 0 is a broadcast on line 0 (serial line guide V1.02, 2.1). If line 0 has
 *   TCP frames, unit 0 is a unit there and answers
 * - {5, 5, 1, MBM_GATEWAY_UNIT_0}: unit 5 is unit 0 on line 1, which has TCP frames
 * - {0, 0, MBM_GATEWAY_ALL_LINES, 0}: unit 0 is a broadcast on each line. On a line with TCP
 *   frames it goes to unit 0, and the gateway drops the response
 */
typedef struct mbm_gatewayRoute {
    /** The first unit id on TCP, 0 to 255. mbm_gateway_begin refuses a greater number. */
    uint16_t first;
    /** The last unit id on TCP, up to 255. */
    uint16_t last;
    /** The index of the line, MBM_GATEWAY_ALL_LINES or MBM_GATEWAY_LOCAL. */
    uint8_t line;
    /** The id on the line of the unit that is `first` on TCP; the units after it follow, up to
     *  255. 0: the ids on the line are those on TCP. MBM_GATEWAY_UNIT_0: `first` has the id 0 on
     *  the line. A request whose unit id on the line is 0 is a broadcast, except on a line
     *  with TCP frames (mbm_client_beginTcp): there unit 0 is a unit. */
    uint16_t unit;
} mbm_gatewayRoute;

/** A line of a gateway. Initialise it with MBM_INIT, then set the fields that you need. */
typedef struct mbm_gatewayLine {
    /** The client of the line, in any framing. Begin it before the gateway, with a frame
     *  buffer that holds every frame. Its settings hold: response timeout, retries, quiet
     *  time. You may send requests of your own with it. Do not replace it by another client
     *  while the gateway has open connections. */
    mbm_client *client;
    /** Your pointer, passed to `isReady`; may be NULL. */
    void *context;
    /** Optional: called before each request to the line. Returns 1 if the line can take it, 0
     *  if the gateway shall answer with exception 0A, for example because a terminal is not
     *  open. It may call every function on the client except mbm_client_poll, and no function
     *  on the gateway (MBM_BUSY). */
    uint8_t (*isReady)(void *context);
    /** The most requests that the gateway queues in the client at a time, 1 to 16; 0 means 1.
     *  With 1, the clients on TCP take turns with every request. If the line is a TCP
     *  connection to a device that takes several requests at once, it can have more in flight:
     *  as many as mbm_client_setInFlight allows its client. */
    uint8_t inFlight;
    uint8_t last; /**< Private. */
} mbm_gatewayLine;

/** A place for a TCP connection. */
typedef struct mbm_gatewayConnection {
    mbm_port port; /**< Private. */
    uint32_t words[3]; /**< Private. */
} mbm_gatewayConnection;

/**
 * A place for a request, which then holds its response. It has about 340 bytes on a 32-bit
 * machine.
 */
typedef struct mbm_gatewayRequest {
    mbm_clientRequest request; /**< Private. */
    uint32_t words[5]; /**< Private. */
    uint8_t frame[MBM_MAX_TCP_FRAME]; /**< Private. */
} mbm_gatewayRequest;

/** The parts of a gateway. The gateway copies this struct, but not the arrays that it points to. */
typedef struct mbm_gatewayConfig {
    /** The map of units. It may be in flash. A program may also change it between two calls of
     *  the gateway: then it holds for the requests that are received later. Each route must be
     *  valid; one whose `last` is below its `first` leads nowhere. */
    const mbm_gatewayRoute *routes;
    /** The lines; may be NULL if `lineCount` is 0. */
    mbm_gatewayLine *lines;
    /** The places for connections. The index in this array is the connection's number. */
    mbm_gatewayConnection *connections;
    /** The places for requests. Each connection always has one. Connections that send several
     *  requests without waiting for the replies share the others. */
    mbm_gatewayRequest *requests;
    /** The number of `requests`, at least `connectionCount` and below 65535. */
    uint16_t requestCount;
    /** The number of `routes`, at least 1. */
    uint8_t routeCount;
    /** The number of `lines`, 0 to 253. */
    uint8_t lineCount;
    /** The number of `connections`, at least 1. */
    uint8_t connectionCount;
} mbm_gatewayConfig;

/**
 * Begins a gateway without connections.
 *
 * You may call it again at any time, also with another config. The gateway then gives up all
 * connections and their requests; it cancels those that a line has, and its settings return
 * to their defaults. A call that is refused changes nothing.
 *
 * @param config  the parts of the gateway. All memory that it points to must stay valid, and
 *                must be used by this gateway only, for as long as the gateway is used; lines,
 *                connections and requests are initialised with MBM_INIT
 * @return a status; MBM_INVALID_ARGUMENT for fewer requests than connections, a route to a line
 *         that does not exist or to a unit id above 255, unless it is MBM_GATEWAY_UNIT_0, and
 *         a line without client;
 *         MBM_NOT_INITIALISED if the client of a line was not begun; MBM_BUSY also from within a
 *         hook of a client of its lines
 */
uint8_t mbm_gateway_begin(mbm_gateway *gateway, const mbm_gatewayConfig *config);

/**
 * Polls the clients of all lines, receives requests, passes them on, and sends responses.
 * Never waits.
 *
 * Call it often. You need not poll the clients of the lines; you may.
 *
 * @return a status; MBM_BUSY also from within a hook of a port of its lines
 */
uint8_t mbm_gateway_poll(mbm_gateway *gateway);

/**
 * Returns for how long mbm_gateway_poll will have nothing to do, unless a byte arrives on a
 * line whose client has requests, or on a connection that the gateway reads (see
 * mbm_gateway_isReading), or a connection is lost.
 *
 * @return microseconds; 0 means poll now, also from within a hook of the gateway; 0xFFFFFFFF means
 *         that no request is pending. While a connection does not accept a response, and while a
 *         function of the gateway's own units returns MBM_REPLY_PENDING, it is at most 1000
 */
uint32_t mbm_gateway_pollDelay(mbm_gateway *gateway);

/**
 * Gives the gateway an accepted TCP connection. mbm_gateway_poll then reads its requests and
 * writes their responses. The gateway never opens or closes the socket itself.
 *
 * @param connection  the number of a free place, below `connectionCount`
 * @param port        the connection; is copied. Its hooks read, write and micros are required. The
 *                    clocks of all connections count the same time
 * @return a status; MBM_BUSY if the place has an open connection
 */
uint8_t mbm_gateway_open(mbm_gateway *gateway, uint8_t connection, const mbm_port *port);

/**
 * Gives up a connection and its requests. A request that a line has is cancelled: the device
 * may have received it, and the gateway discards its reply. The place is free then.
 *
 * @param connection  the number of the place; nothing happens if it is free already
 * @return a status; MBM_BUSY also from within a hook of a port of its lines
 */
uint8_t mbm_gateway_close(mbm_gateway *gateway, uint8_t connection);

/**
 * Returns the state of a connection. Call it after mbm_gateway_poll for each connection: if the
 * connection is lost, close its socket, and call mbm_gateway_close or mbm_gateway_open.
 *
 * @param connection  the number of the place
 * @return MBM_OK while the connection is open; MBM_LINK_LOST if its port reported that the
 *         connection is lost; MBM_MALFORMED_FRAME if it sent bytes that are not Modbus TCP;
 *         MBM_NOT_INITIALISED for a free place
 */
uint8_t mbm_gateway_status(const mbm_gateway *gateway, uint8_t connection);

/**
 * Returns how many requests of a connection are pending: complete, but not answered yet.
 * The connection is not idle while it has one.
 *
 * @param connection  the number of the place
 * @return the number of requests; 0 for a free place and for a number out of range
 */
uint16_t mbm_gateway_pending(const mbm_gateway *gateway, uint8_t connection);

/**
 * Returns whether the next mbm_gateway_poll reads bytes from a connection. If not, the
 * connection has as many pending requests as it may have, and its next requests wait in its
 * socket: do not wait for bytes of it.
 *
 * @param connection  the number of the place
 * @return 1 or 0
 */
uint8_t mbm_gateway_isReading(const mbm_gateway *gateway, uint8_t connection);

/**
 * Sets how many requests of one connection may be pending at once
 * (NumberMaxOfServerTransaction of the messaging on TCP/IP guide V1.0b, 4.4.1). The next
 * requests of the connection wait in its socket.
 *
 * @param most  1 to 65535; the default is 65535. Fewer if there are not enough places for requests
 */
uint8_t mbm_gateway_setMaxPending(mbm_gateway *gateway, uint16_t most);

/**
 * Sets for how long a request may wait until its line is free. After that time the gateway
 * answers it with exception 0A and does not send it. Set it to the time that the clients on
 * TCP wait, less the response timeout of the line: then no device carries out a request that
 * its client has given up.
 *
 * @param timeMs  milliseconds, 1 to 1000000 (16 minutes); 0, the default, lets requests wait for
 *                any time
 */
uint8_t mbm_gateway_setQueueTime(mbm_gateway *gateway, uint32_t timeMs);

/**
 * Serves units of the gateway itself: those that a route to MBM_GATEWAY_LOCAL leads to. The
 * unit ids that such a route maps to are those of the units; 0 and 255 address the first
 * unit. A request for an id that no unit has gets no response.
 *
 * A function of a unit that returns MBM_REPLY_PENDING is called again at each
 * mbm_gateway_poll. Other requests go on meanwhile, also those for the same unit.
 *
 * @param units  one unit, or an array of units; must stay valid for as long as the gateway is
 *               used. Servers may serve the same units. NULL only if `count` is 0
 * @param count  how many units
 * @return a status; MBM_INVALID_ARGUMENT for a unit with an id above 255
 */
uint8_t mbm_gateway_serveUnits(mbm_gateway *gateway, struct mbm_unit *units, uint8_t count);

/**
 * Declares functions of your own. The gateway passes on every function. If one of your own is
 * declared, the gateway also checks the length of its requests, and knows on RTU when its
 * replies end without waiting for a silence.
 *
 * @param functions  the declarations; they must stay valid for as long as the gateway is used.
 *                   NULL only if `count` is 0
 * @param count      how many declarations
 * @return a status; MBM_INVALID_ARGUMENT for a declaration that is not valid
 */
uint8_t mbm_gateway_setFunctions(mbm_gateway *gateway, const mbm_function *functions,
                                 uint8_t count);

#ifdef __cplusplus
}  // extern "C"
#endif

#endif  /* MBM_GATEWAY_H */
