"""Instructions of the controller that drive nowhere: what is called by another name is a routine of somebody's."""

from __future__ import annotations

INSTRUCTIONS = frozenset("""
accset actevbuffer activateev activatesupervision actunit aliasio aliasioreset bitclear bitset bookerrno break
callbyvar cancelload checkprogref circpathmode clear cleariobuff clearpath clearrawbytes clkreset clkstart clkstop
close closedir confj confl connect contactl copyfile copyrawbytes corrclear corrcon corrdiscon corrwrite deactevbuffer
deactivatesupervision deactunit decr dropsensor dropwobj egmactjoint egmactmove egmactpose egmgetid egmreset
egmsetupai egmsetupao egmsetupgi egmsetupltapp egmsetupuc egmstop egmstreamstart egmstreamstop eoffsoff eoffson
eoffsset erasemodule errlog errraise errwrite exit exitcycle eyesafety fcact fccalib fccondforce fccondpos
fccondwaitwhile fcconnect fcdeact fcdisconnect fcloadid fcrefforce fcrefline fcrefmoment fcrefrot fcrefstart fcrefstop
fcsetdampingtune fcsetlptunefilter fcspdchgact fcspdchgdeact fcspdchgtunset getdatavalue getsysdata gettrapdata goto
gripload hollowwristreset idelete idisable ienable ierror incr indamove indcmove inddmove indreset indrmove
interruptpath invertdo iodisable ioenable iopers ipathpos iselaborate isignalai isignalao isignaldi isignaldo
isignalgi isignalgo isleep itimer ivarvalue iwatch load loadid makedir manloadidproc mechunitload motionprocessmodeset
motionsup moveextj mtoolrotcalib mtooltcpcalib open opendir packdnheader packrawbytes pathaccset pathlengthreset
pathlengthstart pathlengthstop pathrecstart pathrecstop pathresol pdispadd pdispoff pdispon pdispset procerrrecovery
pulsedo raise raisetouser readanybin readblock readcfgdata readerrdata readrawbytes recoverreset removedir removefile
renamefile reset resetaxisdistance resetaxismovetime resetpptomoved resetretrycount resettorquemargin restopath
resumepath retry return rewind rmqemptyqueue rmqfindslot rmqgetmessage rmqgetmsgdata rmqgetmsgheader rmqreadwait
rmqsendmessage rmqsendwait save scwrite searchextj senddevice set setao setdatasearch setdatavalue setdo setgo
setleadthrough setsysdata setupcyclic setuppsupervision setuptrigger sicalclear siclose siconnect sigetcyclic singarea
sisetcyclic socketaccept socketbind socketclose socketconnect socketcreate socketlisten socketreceive
socketreceivefrom socketsend socketsendto softact softdeact softelbow speedlimaxis speedlimcheckpoint speedrefresh
spyclear spystart spystop startload startmove startmoveretry stcalib stclose stindgun stindgunreset stmove stop stopen
stopmove stopmovereset storepath sttune sttunereset supsyncsensoroff supsyncsensoron syncmoveoff syncmoveon
syncmoveresume syncmovesuspend syncmoveundo synctosensor systemstopaction test testsigndefine testsignreset
textabinstall tperase tpreaddnum tpreadfk tpreadnum tpshow tpwrite triggcheckio triggdataclear triggdatareset
triggequip triggint triggio triggrampao triggspeed triggstopproc trynext tunereset tuneservo uimsgbox uimsgwrite
uimsgwriteabort uishow unload unpackrawbytes velset vsmon vson waitai waitao waitdi waitdo waitgi waitgo waitload
waitrob waitsensor waitsynctask waittestandset waittime waituntil waitwobj warmstart wobjcalib worldacclim write
writeanybin writebin writeblock writecfgdata writerawbytes writestrbin writevar wzboxdef wzcyldef wzdisable wzdoset
wzenable wzfree wzhomejointdef wzlimjointdef wzlimsup wzsphdef wzvarlim
""".split())
