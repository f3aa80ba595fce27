// A USB host for a serial port (CDC) of the emulated chip. It does as Linux does: it enumerates the device, opens the port, asks
// for data all the time, and ends a transfer with a packet that is not full, or with the 128th byte.
//
// rp2040js brings a host, USBCDC, which this replaces, for three reasons:
// - It forgets an OUT endpoint that the device makes ready before the host has read the descriptors. rp2040-hal makes all
//   endpoints ready at the bus reset, as a device may. Such a device never receives a byte. TinyUSB is ready later.
// - It expects 9 bytes of the configuration descriptor in one packet. Packets of endpoint 0 may have 8.
// - It answers each ready OUT endpoint within 10 us with an empty packet if it has no data. A real host sends nothing.
import { createSetupPacket, DataDirection, DescriptorType, SetupRecipient, SetupRequest, SetupType } from 'rp2040js';

const CONFIGURATION = 2; // the type of a descriptor
const PACKET = 64;
const TRANSFER = 128;
const MILLISECOND = 1e6; // in nanoseconds
const DTR = 1, RTS = 2;
const SET_LINE_CODING = 0x20, SET_CONTROL_LINE_STATE = 0x22;
const SIE_STATUS = 0x50, SUSPENDED = 1 << 4;
const EP0_IN_BUFFER_CONTROL = 0x80, EP15_OUT_BUFFER_CONTROL = 0xfc, AVAILABLE = 1 << 10;

/** The numbers of the bulk endpoints of the interface with data. */
function endpoints(descriptors) {
    const found = {};
    let isData = false;
    for (let at = 0; at < descriptors.length; at += descriptors[at] || 256) {
        if (descriptors[at + 1] === DescriptorType.Interface) isData = descriptors[at + 5] === 10;
        if (isData && descriptors[at + 1] === DescriptorType.Endpoint) {
            found[descriptors[at + 2] & 0x80 ? 'in' : 'out'] = descriptors[at + 2] & 0xf;
        }
    }
    return found;
}

export class UsbHost {
    /** Connects the device. `received` gets the bytes of each transfer, `opened` is called once the port is open. */
    constructor(chip, received, opened) {
        Object.assign(this, { usb: chip.usbCtrl, received, opened, reads: true });
        this.forget();
        this.pause = chip.clock.createAlarm(() => this.next());
        const { usb } = this;
        usb.onUSBEnabled = () => this.plug();
        usb.onResetReceived = () => { this.forget(); this.enumerate(); };
        usb.onEndpointRead = (endpoint, size) => { this.ready.set(endpoint, size); this.give(endpoint); };
        usb.onEndpointWrite = (endpoint, packet) => (endpoint === 0 ? this.control(packet) : this.data(endpoint, packet));
        // A host that asks for no data leaves the packet in the device.
        const made = usb.DPRAMUpdated.bind(usb);
        usb.DPRAMUpdated = (offset, value) => {
            const isIn = offset > EP0_IN_BUFFER_CONTROL && offset <= EP15_OUT_BUFFER_CONTROL && !(offset & 4);
            if (isIn && value & AVAILABLE && !this.reads) this.held.push([offset, value]);
            else made(offset, value);
        };
        this.release = () => this.held.splice(0).forEach((packet) => made(...packet));
        // The emulator has no way to clear this bit.
        const write = usb.writeUint32.bind(usb);
        usb.writeUint32 = (offset, value) => {
            if (offset === SIE_STATUS && usb.rawWriteValue & SUSPENDED) usb.sieStatus &= ~SUSPENDED;
            write(offset, value);
        };
    }

    forget() {
        Object.assign(this, { ready: new Map(), queues: new Map(), transfers: [], transfer: null, pieces: [], held: [], found: {},
            packet0: undefined });
    }

    plug() {
        if (!this.isPlugged) {
            this.isPlugged = true;
            this.usb.resetDevice();
        }
    }

    /** Pulls the cable: for a chip that its board goes on to supply, the bus is suspended. */
    unplug() {
        this.isPlugged = false;
        this.forget();
        this.usb.sieStatus |= SUSPENDED;
        this.usb.sieStatusUpdated();
    }

    /** Asks for data, or leaves it in the device, as with a program that does not read its port. */
    read(reads) {
        this.reads = reads;
        if (reads) this.release();
    }

    send(bytes) {
        for (let at = 0; at < bytes.length; at += PACKET) this.push(this.found.out, bytes.slice(at, at + PACKET));
    }

    push(endpoint, packet) {
        if (endpoint === undefined) return;
        if (!this.queues.has(endpoint)) this.queues.set(endpoint, []);
        this.queues.get(endpoint).push(packet);
        this.give(endpoint);
    }

    /** Sends a packet once there is one and the device is ready for it. */
    give(endpoint) {
        const queue = this.queues.get(endpoint) ?? [];
        if (queue.length && this.ready.has(endpoint)) {
            this.ready.delete(endpoint);
            this.usb.endpointReadDone(endpoint, queue.shift());
        }
    }

    data(endpoint, packet) {
        if (endpoint !== this.found.in) return;
        this.pieces.push(...packet);
        if (packet.length < PACKET || this.pieces.length >= TRANSFER) {
            const bytes = this.pieces.splice(0);
            if (bytes.length) this.received(Uint8Array.from(bytes));
        }
    }

    // --- control transfers

    request(isIn, type, recipient, bRequest, wValue, length, data, done) {
        const setup = createSetupPacket({ dataDirection: isIn ? DataDirection.DeviceToHost : DataDirection.HostToDevice,
            type, recipient, bRequest, wValue, wIndex: 0, wLength: length });
        this.transfers.push({ setup, isIn, length, data, done, pieces: [] });
        if (!this.transfer) this.pause.schedule(MILLISECOND);
    }

    next() {
        this.transfer = this.transfers.shift() ?? null;
        if (!this.transfer) return;
        // What was ready for the transfer before is not for this one.
        this.ready.delete(0);
        this.queues.delete(0);
        this.usb.sendSetupPacket(this.transfer.setup);
        if (this.transfer.data) this.push(0, this.transfer.data);
    }

    control(packet) {
        const { transfer } = this;
        if (!transfer) return;
        if (transfer.isIn) {
            transfer.pieces.push(...packet);
            // The device descriptor says at 7 how long a full packet is.
            this.packet0 ??= transfer.pieces[7];
            if (packet.length === this.packet0 && transfer.pieces.length < transfer.length) return;
            // The empty packet of the status stage.
            this.push(0, new Uint8Array(0));
        }
        this.transfer = null;
        transfer.done?.(transfer.pieces);
        this.pause.schedule(MILLISECOND);
    }

    enumerate() {
        const standard = (isIn, request, value, length, done) =>
            this.request(isIn, SetupType.Standard, SetupRecipient.Device, request, value, length, null, done);
        const ofClass = (request, value, data, done) => this.request(false, SetupType.Class, SetupRecipient.Interface,
            request, value, data ? data.length : 0, data, done);
        const configuration = CONFIGURATION << 8;
        standard(true, SetupRequest.GetDescriptor, DescriptorType.Device << 8, 18);
        standard(false, SetupRequest.SetAddress, 1, 0);
        standard(true, SetupRequest.GetDescriptor, configuration, 9, (head) => {
            standard(true, SetupRequest.GetDescriptor, configuration, head[2] | (head[3] << 8), (all) => {
                this.found = endpoints(all);
                standard(false, SetupRequest.SetDeviceConfiguration, 1, 0);
                // 9600 baud, 8N1.
                ofClass(SET_LINE_CODING, 0, Uint8Array.from([0x80, 0x25, 0, 0, 0, 0, 8]));
                ofClass(SET_CONTROL_LINE_STATE, DTR | RTS, null, () => this.opened());
            });
        });
    }

    /** Opens or closes the port, as a program on the host does. */
    setOpen(isOpen) {
        this.request(false, SetupType.Class, SetupRecipient.Interface, SET_CONTROL_LINE_STATE, isOpen ? DTR | RTS : 0, 0, null);
    }
}
