package main

import (
	"container/list"
	"crypto/tls"
	"log/slog"
	"net"
	"sync"
	"sync/atomic"
	"time"

	"github.com/mochi-mqtt/server/v2/listeners"
)

const (
	handshakeTime = 3 * time.Second        // for TLS and CONNECT
	writeTime     = 5 * time.Second        // for one write; longer, and the client is as good as gone
	endTime       = 200 * time.Millisecond // for the last packet to a client whose session another connection takes over
	mostPending   = 256                    // connections that have not finished CONNECT; one more ends the oldest
	acceptPause   = 50 * time.Millisecond  // after a connection that could not be accepted, as without descriptors
	complaintTime = 10 * time.Second       // between two log lines about that
)

// connection is a client's connection: the deadlines of reading are the library's, those of writing its own.
type connection struct {
	net.Conn
	raw     net.Conn      // the same without TLS
	place   *list.Element // among the pending
	asked   uint16        // the packet id of the QoS 1 message that is being handled
	ending  atomic.Bool
	settle  func()        // once its session is established, or it is over
	settled chan struct{} // closed by settle
	done    chan struct{} // closed when the library has forgotten it
}

// SetDeadline sets the deadline of reading alone: the library means the keep-alive by it.
func (c *connection) SetDeadline(t time.Time) error { return c.raw.SetReadDeadline(t) }

// Write ends the connection where it fails: a part of a packet may have been sent, and nothing may follow it.
func (c *connection) Write(bytes []byte) (int, error) {
	limit := writeTime
	if c.ending.Load() {
		limit = endTime
	}
	_ = c.raw.SetWriteDeadline(time.Now().Add(limit))
	count, err := c.Conn.Write(bytes)
	if err != nil {
		_ = c.raw.Close()
	}
	return count, err
}

// hurry lets what is being written now, and from now on, fail within endTime.
func (c *connection) hurry() {
	c.ending.Store(true)
	_ = c.raw.SetWriteDeadline(time.Now().Add(endTime))
}

// listener accepts connections, whatever comes: a lack of descriptors is waited for, and who only connects is ended.
type listener struct {
	address  string
	security *tls.Config // nil: none
	sessions *sessions
	socket   net.Listener
	lock     sync.Mutex
	pending  *list.List // of *connection, the oldest first
	open     map[*connection]struct{}
	isClosed bool
}

func newListener(address string, security *tls.Config, sessions *sessions) *listener {
	return &listener{
		address: address, security: security, sessions: sessions,
		pending: list.New(), open: map[*connection]struct{}{},
	}
}

func (l *listener) ID() string       { return "tcp" }
func (l *listener) Address() string  { return l.address }
func (l *listener) Protocol() string { return "tcp" }

func (l *listener) Init(*slog.Logger) (err error) {
	l.socket, err = net.Listen("tcp", l.address)
	return err
}

// Serve accepts until Close. Go sets TCP_NODELAY on every connection, without which a command waits 40 ms.
func (l *listener) Serve(establish listeners.EstablishFn) {
	var complained time.Time
	for {
		raw, err := l.socket.Accept()
		if err == nil {
			go l.serve(l.register(raw), establish)
			continue
		}
		l.lock.Lock()
		isClosed := l.isClosed
		l.endOldest(0)
		l.lock.Unlock()
		if isClosed {
			return
		}
		if time.Since(complained) > complaintTime {
			logLine("WARNING", "no connection can be accepted now (%v); trying again", err)
			complained = time.Now()
		}
		time.Sleep(acceptPause)
	}
}

func (l *listener) register(raw net.Conn) *connection {
	c := &connection{Conn: raw, raw: raw, settled: make(chan struct{}), done: make(chan struct{})}
	if l.security != nil {
		c.Conn = tls.Server(raw, l.security)
	}
	c.settle = sync.OnceFunc(func() {
		l.lock.Lock()
		l.pending.Remove(c.place)
		l.lock.Unlock()
		close(c.settled)
	})
	_ = raw.SetDeadline(time.Now().Add(handshakeTime))
	l.lock.Lock()
	defer l.lock.Unlock()
	if l.isClosed {
		_ = raw.Close()
	}
	l.open[c] = struct{}{}
	c.place = l.pending.PushBack(c)
	l.endOldest(mostPending)
	return c
}

// endOldest ends the oldest pending connection where there are more than `most`; the lock is held.
func (l *listener) endOldest(most int) {
	if l.pending.Len() > most {
		oldest := l.pending.Front()
		l.pending.Remove(oldest)
		_ = oldest.Value.(*connection).raw.Close()
	}
}

// serve returns when the connection is over.
func (l *listener) serve(c *connection, establish listeners.EstablishFn) {
	defer l.forget(c)
	if secure, is := c.Conn.(*tls.Conn); is && secure.Handshake() != nil {
		return
	}
	_ = establish(l.ID(), c) // what ended it is of no use to a person
}

func (l *listener) forget(c *connection) {
	if failure := recover(); failure != nil {
		logLine("ERROR", "the connection of %v is ended, what it sent could not be handled: %v", c.RemoteAddr(), failure)
	}
	_ = c.raw.Close()
	l.sessions.release(c)
	l.lock.Lock()
	delete(l.open, c)
	l.lock.Unlock()
	close(c.done)
}

// Close ends every connection, those without a client too.
func (l *listener) Close(closeClients listeners.CloseFn) {
	l.lock.Lock()
	isFirst := !l.isClosed
	l.isClosed = true
	l.lock.Unlock()
	if !isFirst {
		return
	}
	_ = l.socket.Close()
	l.each((*connection).hurry)
	closeClients(l.ID())
	l.each(func(c *connection) { _ = c.raw.Close() })
}

func (l *listener) each(do func(*connection)) {
	l.lock.Lock()
	defer l.lock.Unlock()
	for c := range l.open {
		do(c)
	}
}
